"""Paths: continuity, length, turn radius, and their files."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.path import Path
from ferguson_gym.curves.splines import evaluate, subdivide

PROPERTY = settings(max_examples=50, deadline=None, derandomize=True)
LINE = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 4.0]])


def chain(points, derivatives):
    """Segments through points with the derivatives there."""
    return np.stack([points[:-1], points[1:], derivatives[:-1], derivatives[1:]], axis=1)


def random_chain(segments, dimension=2, seed=0):
    stream = np.random.default_rng(seed)
    return chain(*stream.normal(size=(2, segments + 1, dimension)) * 10.0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_chain_is_a_path(dimension):
    control = random_chain(5, dimension)
    path = Path(control)
    assert len(path) == 5
    np.testing.assert_array_equal(path.control, control)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (0, "segments 2 and 3 do not join: their points differ by 0.001"),
        (1, "segments 3 and 4 do not join: their points differ by 0.001"),
        (2, "segments 2 and 3 do not join: their derivatives differ by 0.001"),
        (3, "segments 3 and 4 do not join: their derivatives differ by 0.001"),
    ],
)
def test_a_gap_is_refused_by_its_segments_and_kind(row, message):
    control = random_chain(6)
    control[3, row, 1] += 1e-3
    with pytest.raises(ValueError, match=message):
        Path(control)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_joints_may_differ_by_rounding_alone(scale):
    control = random_chain(3) * scale
    largest = np.abs(control).max()
    control[1, 0, 0] += 0.9e-9 * largest
    assert len(Path(control)) == 3
    control[1, 0, 0] += 0.2e-9 * largest
    with pytest.raises(ValueError, match="do not join"):
        Path(control)


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (LINE, r"a path has shape \(n, 4, D\) with n >= 1, got \(4, 2\)"),
        (np.empty((0, 4, 2)), r"n >= 1, got \(0, 4, 2\)"),
        (np.zeros((2, 2, 4, 2)), r"n >= 1, got \(2, 2, 4, 2\)"),
        (np.zeros((2, 3, 2)), "a control array has shape"),
        (np.full((1, 4, 2), np.nan), "a control array must be finite"),
        ("path", "a control array must be an array of numbers"),
    ],
)
def test_arrays_that_are_not_chains_are_refused(control, message):
    with pytest.raises(ValueError, match=message):
        Path(control)


def test_paths_do_not_change():
    control = random_chain(2)
    path = Path(control)
    before = path.control.copy()
    control += 1.0
    np.testing.assert_array_equal(path.control, before)
    with pytest.raises(ValueError, match="read-only"):
        path.control[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        path.control = control


def test_length_is_the_sum_of_the_segments():
    control = random_chain(7)
    assert Path(control).length == pytest.approx(sum(map(length, control)), rel=1e-14)
    assert Path([LINE]).length == pytest.approx(5.0, rel=1e-12)


def test_length_does_not_change_where_a_segment_is_halved():
    whole = random_chain(1)
    halves = Path(np.stack(subdivide(whole[0])))
    assert halves.length == pytest.approx(Path(whole).length, rel=2e-9)


def test_min_turn_radius_of_a_circle_is_its_radius():
    # 32 cubics with the handles of Bézier circles, whose curvature errs by less than 1e-4
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    handle = 4.0 * np.tan(np.pi / 64)
    points = 25.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    tangents = 25.0 * handle * np.stack([-np.sin(angles), np.cos(angles)], axis=-1)
    path = Path(chain(points, tangents))
    assert path.min_turn_radius == pytest.approx(25.0, rel=1e-4)
    assert path.length == pytest.approx(50.0 * np.pi, rel=1e-6)


def test_min_turn_radius_is_that_of_the_sharpest_segment():
    # y = x^2 turns with a radius of (1 + 4 x^2)^1.5 / 2, least at x = 0
    x = np.array([-5.0, -3.0, -1.0, 1.0, 3.0])
    parabola = chain(np.stack([x, x**2], axis=-1), 2.0 * np.stack([np.ones(5), 2 * x], axis=-1))
    assert Path(parabola).min_turn_radius == pytest.approx(0.5, rel=1e-12)
    assert Path(parabola[:2]).min_turn_radius == pytest.approx(0.5 * 5.0**1.5, rel=1e-12)
    assert Path(parabola[3:]).min_turn_radius == pytest.approx(0.5 * 5.0**1.5, rel=1e-12)


@pytest.mark.parametrize("derivatives", [(3.0, 3.0), (1.0, 8.0)])
def test_min_turn_radius_is_infinite_on_a_line(derivatives):
    control = np.array([0.0, 3.0, *derivatives])[:, None] * [1.0, 0.0]
    assert Path([control]).min_turn_radius == np.inf


def test_min_turn_radius_is_zero_at_a_cusp():
    assert Path([[[0, 0], [4, 3], [0, 0], [1, 5]]]).min_turn_radius == 0.0


@pytest.mark.parametrize("per_segment", [1, 7, 50])
def test_points_run_along_the_path_and_meet_every_joint(per_segment):
    path = Path(random_chain(4))
    points = path.points(per_segment)
    assert points.shape == (4 * per_segment + 1, 2)
    np.testing.assert_allclose(points[:-1:per_segment], path.control[:, 0], atol=1e-12)
    np.testing.assert_array_equal(points[-1], path.control[-1, 1])
    t = np.arange(per_segment) / per_segment
    second = points[per_segment : 2 * per_segment]
    np.testing.assert_allclose(second, evaluate(path.control[1], t), atol=1e-12)


@pytest.mark.parametrize("per_segment", [0, -1])
def test_points_need_one_a_segment(per_segment):
    with pytest.raises(ValueError, match=f"at least 1 point a segment, got {per_segment}"):
        Path([LINE]).points(per_segment)


@PROPERTY
@given(
    arrays(
        np.float64,
        st.tuples(st.just(2), st.integers(2, 4), st.integers(1, 3)),
        elements=st.floats(-1e6, 1e6),
    )
)
def test_loading_gives_the_same_numbers_bit_for_bit(tmp_path_factory, rows):
    written = Path(chain(*rows))
    file = tmp_path_factory.getbasetemp() / "path.json"
    written.save(file)
    assert Path.load(file).control.tobytes() == written.control.tobytes()


def test_saving_replaces_the_file_and_leaves_nothing_else(tmp_path):
    for seed in range(2):
        Path(random_chain(2, seed=seed)).save(str(tmp_path / "path.json"))
    expected = random_chain(2, seed=1)
    np.testing.assert_array_equal(Path.load(tmp_path / "path.json").control, expected)
    assert [file.name for file in tmp_path.iterdir()] == ["path.json"]


BROKEN = random_chain(2)
BROKEN[1, 0] += 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Expecting value"),
        ("[1, 2]", r"a path is a JSON object with control, \(n, 4, D\) numbers"),
        ("{}", "a path is a JSON object with control"),
        ('{"control": []}', "a control array has shape"),
        ('{"control": null}', "must be an array of numbers, got None"),
        ('{"control": [[[0, 0], [1, 1], [1, NaN], [1, 1]]]}', "must be finite"),
        ('{"control": [[[0, 0], [1], [1, 1], [1, 1]]]}', "must be an array of numbers"),
        (json.dumps({"control": BROKEN.tolist()}), "segments 0 and 1 do not join"),
        ("[" * 100_000, "nested too deeply"),
        (b"\xff\xfe{}", "decode"),
    ],
)
def test_a_bad_file_is_named_with_its_fault(tmp_path, text, message):
    file = tmp_path / "bad.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=rf"bad\.json: .*{message}"):
        Path.load(file)


def test_a_missing_file_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.json"):
        Path.load(tmp_path / "nowhere.json")


def test_a_straight_path_in_any_direction_never_turns():
    step = 10.0 * np.array([np.cos(0.1), np.sin(0.1)])
    assert Path([[[0, 0], step, step, step]]).min_turn_radius == np.inf
