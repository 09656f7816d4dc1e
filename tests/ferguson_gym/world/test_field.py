"""Discs and fields: what they refuse, that they do not change, and their JSON form."""

import dataclasses
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ferguson_gym.curves import length
from ferguson_gym.curves.clearance import closest
from ferguson_gym.world.field import Field, from_json, to_json
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles

PROPERTY = settings(max_examples=50, deadline=None, derandomize=True)
DISCS = Obstacles.discs([[50.0, 50.0], [20.0, 30.0]], [10.0, 5.0])


def field(**options):
    return Field(**{"name": "test", "obstacles": DISCS} | options)


@pytest.mark.parametrize(
    ("centers", "radii", "message"),
    [
        ([[1, 2]], [0.0], "radii must be positive, got 0 m"),
        ([[1, 2], [3, 4]], [1.0, -2.5], "radii must be positive, got -2.5 m"),
        ([[1, 2]], [np.nan], "radii must be finite, got nan"),
        ([[1, 2]], [np.inf], "radii must be finite, got inf"),
        ([[1, np.nan]], [1.0], "centers must be finite, got nan"),
        ([[-np.inf, 2]], [1.0], "centers must be finite, got -inf"),
        ([[1, 2]], [1.0, 2.0], "got 1 centers and 2 radii"),
        ([], [1.0], "got 0 centers and 1 radii"),
        ([1, 2], [1.0, 2.0], r"centers must have shape \(n, n\), got \(2,\)"),
        ([[1, 2]], 1.0, r"radii must have shape \(n,\), got \(\)"),
        ([[1, 2]], [[1.0]], r"radii must have shape \(n,\), got \(1, 1\)"),
        ([[1, 2], [3]], [1.0, 2.0], "centers must be an array of numbers"),
        ([["a", 2]], [1.0], "centers must be an array of numbers"),
        ([[1, 2]], ["wide"], "radii must be an array of numbers"),
        ([[1, 2]], None, "radii must be an array of numbers, got None"),
        (None, [1.0], "centers must be an array of numbers, got None"),
    ],
)
def test_bad_discs_are_refused(centers, radii, message):
    with pytest.raises(ValueError, match=message):
        Obstacles.discs(centers, radii)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": [np.nan, 0]}, "start must be finite, got nan"),
        ({"goal": [100, np.inf]}, "goal must be finite, got inf"),
        ({"bounds": [-np.inf, 110]}, "bounds must be finite, got -inf"),
        ({"start_derivative": [5, np.nan]}, "start_derivative must be finite, got nan"),
        ({"start": 0.0}, r"start must have shape \(n,\), got \(\)"),
        ({"goal": [100, 100, 100]}, r"as many coordinates, got \(0, 0\) and \(100, 100, 100\)"),
        ({"bounds": [-10, 50, 110]}, r"bounds must be \[least, greatest\] for .* shape \(3,\)"),
        ({"bounds": [[-10], [110]]}, r"or \[\[least of each\], .* shape \(2, 1\)"),
        ({"start_derivative": [5]}, r"start_derivative must have shape \(2,\), got \(1,\)"),
        (
            {"obstacles": Obstacles.discs([[1, 2, 3]], [1])},
            "obstacles have 3 dimensions, start and goal 2",
        ),
        (
            {"obstacles": Obstacles.discs([[50]], [1])},
            "obstacles have 1 dimensions, start and goal 2",
        ),
        ({"start": ["here", 0]}, "start must be an array of numbers"),
        ({"bounds": [110, -10]}, r"bounds must be \(least, greatest\), got \[\[110"),
        ({"bounds": [[-10, 5], [110, 5]]}, r"\(least, greatest\), got \[\[-10.0, 5.0\]"),
        ({"goal": [0, 0]}, r"start and goal coincide at \(0, 0\)"),
        ({"start_derivative": [0, 0]}, r"at least 0.1 m per unit t long, got \(0, 0\)"),
        ({"start_derivative": [0.06, -0.06]}, r"long, got \(0.06, -0.06\)"),
        ({"start": [-11, 0]}, r"start \(-11, 0\) lies outside the bounds \[\[-10.0"),
        ({"goal": [100, 111]}, r"goal \(100, 111\) lies outside the bounds"),
        ({"bounds": [[-10, 1], [110, 110]]}, r"start \(0, 0\) lies outside the bounds"),
        ({"start": [50, 42]}, r"start \(50, 42\) lies 2 m inside obstacle 0"),
        ({"goal": [21, 30]}, r"goal \(21, 30\) lies 4 m inside obstacle 1"),
    ],
)
def test_bad_fields_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        field(**options)


def test_ends_may_touch_discs_and_bounds():
    edge = field(start=[50.0, 40.0], goal=[110.0, -10.0])
    assert edge.obstacles.signed_distance(edge.start).min() == 0.0


def test_defaults_are_those_of_the_paper():
    plain = field()
    assert plain.start.tolist() == [0.0, 0.0]
    assert plain.goal.tolist() == [100.0, 100.0]
    assert plain.bounds.tolist() == [[-10.0, -10.0], [110.0, 110.0]]
    assert plain.distance == pytest.approx(20000**0.5, rel=1e-15)


def test_the_default_start_derivative_points_at_the_goal():
    np.testing.assert_allclose(field(goal=[30.0, 40.0]).departure, [3.0, 4.0], rtol=1e-15)
    np.testing.assert_array_equal(field(start_derivative=[0.0, -7.0]).departure, [0.0, -7.0])


def test_fields_have_any_number_of_dimensions():
    space = Field(
        name="space",
        obstacles=Obstacles.discs([[5.0, 5.0, 5.0]], [1.0]),
        start=[0.0, 0.0, 0.0],
        goal=[2.0, 3.0, 6.0],
        bounds=[0.0, 9.0],
    )
    assert space.bounds.tolist() == [[0.0, 0.0, 0.0], [9.0, 9.0, 9.0]]
    assert space.distance == 7.0
    np.testing.assert_allclose(space.departure, 5.0 / 7.0 * np.array([2.0, 3.0, 6.0]))


@pytest.mark.parametrize("name", ["start", "goal", "bounds", "start_derivative"])
def test_fields_do_not_change(name):
    given_array = np.array([[1.0, 2.0], [60.0, 70.0]] if name == "bounds" else [1.0, 2.0])
    options = {"start": [3.0, 4.0], "goal": [9.0, 9.0]} | {name: given_array}
    one = field(**options)
    kept = getattr(one, name)
    before = kept.copy()
    given_array += 1.0
    np.testing.assert_array_equal(kept, before)
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 7.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(one, name, before)


@pytest.mark.parametrize(("given", "name"), [("centers", "points"), ("radii", "radii")])
def test_discs_do_not_change(given, name):
    given_arrays = {"centers": np.array([[1.0, 2.0]]), "radii": np.array([3.0])}
    discs = Obstacles.discs(**given_arrays)
    kept = getattr(discs, name)
    before = kept.copy()
    given_arrays[given] += 1.0
    np.testing.assert_array_equal(kept, before)
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 7.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(discs, name, before)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_signed_distance_and_its_gradient(dimension):
    stream = np.random.default_rng(dimension)
    discs = Obstacles.discs(stream.normal(size=(5, dimension)), stream.uniform(0.1, 2.0, 5))
    points = stream.normal(size=(4, 6, dimension))
    distance, gradient = discs.signed_distance(points), discs.gradient(points)
    assert distance.shape == (4, 6, 5)
    assert gradient.shape == (4, 6, 5, dimension)
    offset = points[2, 3] - discs.centers[4]
    assert distance[2, 3, 4] == pytest.approx(np.linalg.norm(offset) - discs.radii[4])
    assert (distance < 0.0).any()
    for axis in range(dimension):
        step = 1e-30j * np.eye(dimension)[axis]
        slope = discs.signed_distance(points + step).imag / 1e-30
        np.testing.assert_allclose(gradient[..., axis], slope, rtol=1e-12)


def test_gradient_is_zero_at_a_centre():
    assert DISCS.gradient(DISCS.centers[0])[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("reach", "radii"), [(29.9, []), (30.0, [10.0]), (40.0, [10.0]), (99.0, [10.0, 5.0])]
)
def test_near_keeps_the_discs_within_reach(reach, radii):
    # the point lies 30 m from the first disc and 62.1 m from the second
    near = DISCS.near([50.0, 90.0], reach)
    assert near.radii.tolist() == radii


def test_empty_discs_obstruct_nothing():
    nothing = Obstacles.discs([], [])
    assert len(nothing) == 0
    assert nothing.signed_distance(np.zeros((3, 2))).shape == (3, 0)
    assert nothing.clearance(np.zeros((4, 2))) == np.inf
    assert len(nothing.near([0.0, 0.0], 1e9)) == 0
    assert len(field(obstacles=nothing).obstacles) == 0


def test_discs_answer_with_the_certified_clearance():
    control = np.random.default_rng(0).uniform(0.0, 100.0, (3, 4, 2))
    expected, where = closest(control, DISCS.centers, DISCS.radii)
    found, t = DISCS.closest(control)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(t, where)
    np.testing.assert_allclose(DISCS.clearance(control), expected.min(axis=-1), rtol=1e-7)


@st.composite
def fields(draw):
    """Fields with every option, in numbers that use all their digits."""
    dimension = draw(st.integers(1, 3))
    numbers = st.floats(0.1, 100.0, exclude_max=True)
    points = arrays(np.float64, (2, dimension), elements=numbers, unique=True)
    discs = arrays(np.float64, (draw(st.integers(1, 4)), dimension + 1), elements=numbers)
    start, goal = draw(points)
    *centers, radii = draw(discs).T
    return Field(
        name="odd numbers",
        obstacles=Obstacles.discs(np.transpose(centers) + 200.0, radii),
        start=-start / 3.0,
        goal=goal,
        bounds=np.stack([-start, goal * 1e90]),
        start_derivative=0.3 * draw(points)[0] + 0.1,
    )


@PROPERTY
@given(fields())
def test_json_gives_the_same_numbers_bit_for_bit(tmp_path_factory, written):
    path = tmp_path_factory.getbasetemp() / f"{written.name}.json"
    to_json(written, path)
    read = from_json(path)
    assert read.name == written.name
    for name in ("start", "goal", "bounds", "start_derivative"):
        assert getattr(read, name).tobytes() == getattr(written, name).tobytes()
    for name in ("centers", "radii"):
        assert getattr(read.obstacles, name).tobytes() == getattr(written.obstacles, name).tobytes()


def test_json_needs_only_centers_and_radii(tmp_path):
    path = tmp_path / "canyon.json"
    path.write_text('{"centers": [[1, 50], [7, 8]], "radii": [2, 3], "start": null}')
    read = from_json(str(path))
    assert read.name == "canyon"
    assert read.obstacles.centers.tolist() == [[1.0, 50.0], [7.0, 8.0]]
    assert read.start.tolist() == [0.0, 0.0]
    path.write_text('{"centers": [], "radii": []}')
    assert len(from_json(path).obstacles) == 0


def test_unknown_keys_are_ignored_with_a_warning(tmp_path):
    path = tmp_path / "canyon.json"
    path.write_text('{"wind": 3, "centers": [[50, 50]], "radii": [2], "colour": "red"}')
    with pytest.warns(UserWarning, match=r"canyon\.json: ignored unknown keys 'colour', 'wind'"):
        read = from_json(path)
    assert read.obstacles.radii.tolist() == [2.0]


def test_known_keys_pass_without_a_warning(tmp_path):
    path = tmp_path / "canyon.json"
    to_json(field(), path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        from_json(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Expecting value"),
        ('{"centers": [[1, 2]', "Expecting"),
        ("[[1, 2]]", "a field is a JSON object"),
        ("{}", "a field needs centers and radii"),
        ('{"radii": [1]}', "a field needs centers"),
        ('{"centers": [[50, 50]], "radii": [0]}', "radii must be positive, got 0 m"),
        ('{"centers": [[50, NaN]], "radii": [1]}', "centers must be finite, got nan"),
        ('{"centers": [[50, 50]], "radii": [1e999]}', "radii must be finite, got inf"),
        ('{"centers": [[50, 50]], "radii": [1, 2]}', "got 1 centers and 2 radii"),
        ('{"centers": [[50, 50], [7]], "radii": [1, 2]}', "centers must be an array of numbers"),
        ('{"centers": null, "radii": [1]}', "centers must be an array of numbers"),
        ('{"centers": {"x": 1}, "radii": [1]}', "centers must"),
        ('{"centers": [[0, 1]], "radii": [3]}', r"start \(0, 0\) lies 2 m inside obstacle 0"),
        ('{"centers": [], "radii": [], "goal": [0, 111]}', r"goal \(0, 111\) lies outside"),
        ('{"centers": [], "radii": [], "bounds": "wide"}', "bounds must be an array of numbers"),
        ("[" * 100_000, "nested too deeply"),
        (f'{{"centers": [[{"9" * 5000}, 1]], "radii": [1]}}', "more digits than can be read"),
        (
            '{"centers": [[9, 9, 9]], "radii": [3], '
            '"obstacles": [{"points": [[9, 9]], "radius": 1}]}',
            "the same dimension, got some of 2 and some of 3 dimensions",
        ),
        (b"\xff\xfe{}", "decode"),
    ],
)
def test_a_broken_file_is_named_with_its_fault(tmp_path, text, message):
    path = tmp_path / "broken.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=rf"broken\.json: .*{message}"):
        from_json(path)


def test_a_byte_order_mark_is_skipped(tmp_path):
    path = tmp_path / "marked.json"
    path.write_text('{"centers": [[50, 50]], "radii": [1]}', encoding="utf-8-sig")
    assert len(from_json(path).obstacles) == 1


def test_a_missing_file_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.json"):
        from_json(tmp_path / "nowhere.json")


def test_other_objects_are_not_obstacles():
    with pytest.raises(TypeError, match="obstacles are Obstacles, got list"):
        field(obstacles=[[1.0, 2.0]])


def test_json_is_plain_and_complete(tmp_path):
    path = tmp_path / "field.json"
    to_json(field(), path)
    assert set(json.loads(path.read_text())) == {
        "centers",
        "radii",
        "start",
        "goal",
        "bounds",
        "start_derivative",
    }


def test_an_empty_field_in_space_can_be_read_back(tmp_path):
    field = Field(
        name="air", obstacles=Obstacles.discs(np.empty((0, 3)), []), start=[0, 0, 0], goal=[9, 9, 9]
    )
    to_json(field, tmp_path / "air.json")
    assert from_json(tmp_path / "air.json").obstacles.dimension == 3


@pytest.mark.parametrize("number", ["1" + 400 * "0", '"50"', "true_"])
def test_numbers_of_a_file_must_be_numbers(number, tmp_path):
    path = tmp_path / "odd.json"
    path.write_text(f'{{"centers": [[{number}, 50]], "radii": [1]}}')
    with pytest.raises(ValueError, match=r"odd\.json"):
        from_json(path)


def test_ragged_bounds_are_named():
    with pytest.raises(ValueError, match="bounds must be an array of numbers"):
        Field(name="ragged", obstacles=Obstacles.discs([], []), bounds=[[1, 2], [3]])


def test_inflated_obstacles_leave_the_rest_of_a_field() -> None:
    field = get_field("paper:2")
    grown = field.inflated(0.5)
    assert field.obstacles.are_discs
    assert grown.obstacles.are_discs
    np.testing.assert_array_equal(grown.obstacles.radii, field.obstacles.radii + 0.5)
    assert replace(grown, obstacles=field.obstacles).name == "paper:2"
    assert grown.limits == field.limits
    np.testing.assert_array_equal(grown.departure, field.departure)
    assert field.inflated(0.0) is field


@pytest.mark.parametrize(
    ("metres", "message"),
    [
        (-0.5, "obstacles are inflated by 0 m or more, got -0.5 m"),
        (np.nan, "obstacles are inflated by 0 m or more, got nan m"),
        (99.0, r"paper:2, with obstacles inflated by 99 m: start \(0, 0\) lies .* m inside obst"),
    ],
)
def test_an_inflation_that_leaves_no_start_is_refused(metres: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        get_field("paper:2").inflated(metres)


def test_a_start_derivative_that_no_segment_has_is_refused() -> None:
    field = get_field("paper:2")
    message = (
        r"at most 65\.856 m per unit t long, since no segment of at most 15 m .* got \(0, 65\.9\), "
        r"65\.9 m per unit t long"
    )
    with pytest.raises(ValueError, match=message):
        replace(field, start_derivative=[0.0, 65.9])
    # the quadratic x' with x'(0) = 65.85 whose absolute value has the least integral
    v, a, b = 65.85, 0.4544225743510721, 0.8405354698523172
    end = v * (1.0 / 3.0 - (a + b) / 2.0 + a * b) / (a * b)
    last = v * (1.0 - a) * (1.0 - b) / (a * b)
    shortest = np.array([[0.0, 0.0], [end, 0.0], [v, 0.0], [last, 0.0]])
    assert 14.99 < length(shortest) < 15.0
    assert replace(field, start_derivative=[0.0, 65.85]).departure[1] == 65.85
