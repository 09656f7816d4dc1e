"""Obstacles of every shape: distances, gradients and certified clearance, and their JSON form."""

import json
from collections.abc import Sequence

import numpy as np
import pytest

from ferguson_gym.curves import evaluate
from ferguson_gym.world.field import Field, from_json, to_json
from ferguson_gym.world.obstacles import Obstacles

SQUARE = [[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]]


def mixed(seed: int, scale: float = 1.0) -> Obstacles:
    """Polygons, thin ones among them, capsules, boxes and discs, many of which overlap."""
    stream = np.random.default_rng(seed)
    middles = stream.uniform(0.0, 60.0, (6, 1, 2))
    polygons = list(middles + stream.normal(size=(6, 3, 2)) * [[[8.0, 0.02 + seed % 2 * 4.0]]])
    low = stream.uniform(0.0, 60.0, (3, 2))
    parts = [
        Obstacles.polygons(polygons, stream.choice([0.0, 1.0], 6)),
        Obstacles.capsules(stream.uniform(0.0, 60.0, (4, 2, 2)), 10.0 ** stream.uniform(-3, 1, 4)),
        Obstacles.boxes(low, low + stream.uniform(0.1, 9.0, (3, 2))),
        Obstacles.discs(stream.uniform(0.0, 60.0, (3, 2)), stream.uniform(1.0, 4.0, 3)),
    ]
    return Obstacles.joined(parts).rescaled(np.zeros(2), scale)


def segments(seed: int, number: int, scale: float = 1.0) -> np.ndarray:
    stream = np.random.default_rng(seed)
    control = stream.normal(size=(number, 4, 2)) * 9.0
    control[:, 0] = stream.uniform(0.0, 60.0, (number, 2))
    control[:, 1] += control[:, 0]
    return scale * control


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("seed", range(4))
def test_clearance_is_never_above_what_samples_show_and_reaches_it(seed: int, scale: float) -> None:
    obstacles, control = mixed(seed, scale), segments(seed, 40, scale)
    clear, where = obstacles.closest(control)
    sampled = np.stack(
        [obstacles.signed_distance(points) for points in evaluate(control, np.linspace(0, 1, 2001))]
    )
    assert (clear <= sampled.min(axis=1)).all()
    there = np.stack([evaluate(one, t) for one, t in zip(control, where, strict=True)])
    attained = np.stack([np.diagonal(obstacles.signed_distance(points)) for points in there])
    np.testing.assert_allclose(clear, attained, rtol=0.0, atol=4e-7 * scale)
    np.testing.assert_allclose(obstacles.clearance(control), clear.min(axis=1), atol=1e-7 * scale)


def along(points: Sequence[Sequence[float]]) -> np.ndarray:
    """A straight segment from one point to another."""
    start, end = np.array(points, dtype=float)
    return np.stack([start, end, end - start, end - start])


@pytest.mark.parametrize(
    ("points", "clearance"),
    [
        ([[0.0, 4.0], [8.0, 4.0]], 0.0),  # along an edge
        ([[0.0, 0.0], [2.0, 2.0]], 0.0),  # ends on a corner
        ([[0.0, 4.0], [4.0, 0.0]], 0.0),  # touches a corner exactly
        ([[0.0, 5.0], [5.0, 0.0]], -0.5),  # cuts a corner off: deepest half way
        ([[0.0, 0.0], [6.0, 6.0]], -1.0),  # along the diagonal
        ([[3.0, 3.0], [3.5, 3.0]], -1.0),  # starts in the middle
        ([[0.0, 4.5], [8.0, 4.5]], 0.5),
        ([[6.0, 0.0], [6.0, 8.0]], 2.0),
    ],
)
def test_known_clearances_from_a_square(points: list[list[float]], clearance: float) -> None:
    for radius in (0.0, 0.25):
        square = Obstacles.polygons([SQUARE], radius)
        found = float(square.clearance(along(points)))
        assert found <= clearance - radius
        assert found == pytest.approx(clearance - radius, abs=1e-7)


def test_balls_and_capsules_in_space() -> None:
    stream = np.random.default_rng(0)
    obstacles = Obstacles.joined(
        [
            Obstacles.capsules(stream.uniform(0.0, 9.0, (5, 2, 3)), 0.3),
            Obstacles.discs(stream.uniform(0.0, 9.0, (5, 3)), np.full(5, 0.5)),
        ]
    )
    control = stream.uniform(0.0, 9.0, (30, 4, 3))
    sampled = [obstacles.signed_distance(one) for one in evaluate(control, np.linspace(0, 1, 2001))]
    clear, least = obstacles.closest(control)[0], np.stack(sampled).min(axis=1)
    assert (clear <= least).all()
    np.testing.assert_allclose(clear, least, atol=1e-3)
    with pytest.raises(
        ValueError, match="core 0 has 3 points in 3 dimensions; polygons are planar"
    ):
        Obstacles.hulls([np.eye(3)], 1.0)


def test_gradients_are_those_of_distances() -> None:
    obstacles, points, step = mixed(1), np.random.default_rng(2).uniform(0, 60, (200, 2)), 1e-6
    numbers = []
    for shift in np.eye(2) * step:
        ahead, behind = (obstacles.signed_distance(points + s * shift) for s in (1.0, -1.0))
        numbers.append((ahead - behind) / (2.0 * step))
        complex_step = obstacles.signed_distance(points + 1j * shift / step * 1e-20)
        slope = obstacles.gradient(points) @ shift / step
        np.testing.assert_allclose(complex_step.imag * 1e20, slope)
    difference = np.abs(np.stack(numbers, axis=-1) - obstacles.gradient(points)).max(axis=-1)
    assert np.quantile(difference, 0.99) < 1e-5  # it jumps inside, where two edges are as near


def test_no_points_have_no_distances() -> None:
    obstacles, none = mixed(0), np.empty((0, 2))
    assert obstacles.signed_distance(none).shape == (0, len(obstacles))
    assert obstacles.gradient(none).shape == (0, len(obstacles), 2)


def test_points_are_free_outside_all_obstacles() -> None:
    obstacles, points = mixed(3), np.random.default_rng(4).uniform(0.0, 60.0, (500, 3, 2))
    expected = (obstacles.signed_distance(points) >= 0.0).all(axis=(1, 2))
    np.testing.assert_array_equal(obstacles.are_free(points), expected)
    assert 50 < expected.sum() < 450


def test_chosen_grown_and_moved_obstacles() -> None:
    obstacles, point = mixed(5), np.array([30.0, 20.0])
    distance = obstacles.signed_distance(point)
    near = obstacles.near(point, 12.0)
    np.testing.assert_array_equal(near.signed_distance(point), distance[distance <= 12.0])
    grown = obstacles.grown(np.arange(len(obstacles)) * 0.1)
    shown = distance - np.arange(len(obstacles)) * 0.1
    np.testing.assert_allclose(grown.signed_distance(point), shown)
    moved = obstacles.rescaled(np.array([30.0, 20.0]), 2.0)
    np.testing.assert_allclose(moved.signed_distance(np.zeros(2)), 2.0 * distance)
    centers, radii = obstacles.balls
    for k in range(len(obstacles)):
        away = np.linalg.norm(obstacles.core(k) - centers[k], axis=1) + obstacles.radii[k]
        assert (away <= radii[k]).all()


def test_points_of_a_core_are_its_hull_and_the_user_hears_of_it_once() -> None:
    with pytest.warns(
        UserWarning, match="obstacle 0 and 1 more are not in convex position"
    ) as heard:
        made = Obstacles.hulls([[*SQUARE, [3.0, 3.0]], [[0, 0]], [*SQUARE, [3.0, 2.5]]], 1.0)
    assert len(heard) == 1
    assert made.core(0).tolist() == SQUARE
    # neither repeated corners, nor those on an edge, nor their order matter
    same = Obstacles.hulls(
        [[SQUARE[2], [3.0, 2.0], SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[3]]], 0.0
    )
    assert same.core(0).tolist() == SQUARE
    assert Obstacles.hulls([[[0, 0], [1, 1], [2, 2]]], 1.0).core(0).tolist() == [[0, 0], [2, 2]]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Obstacles.hulls([[[0, 0]], []], 1.0), "core 1 has no points"),
        (lambda: Obstacles.hulls([[[0, np.nan]]], 1.0), "core 0 must be finite, got nan"),
        (lambda: Obstacles.hulls([[[0, 0], [1, 1]]], 0.0), "core without an area, obstacle 0"),
        (lambda: Obstacles.hulls([[[0, 0], [1, 1], [2, 2]]], [0.0]), "without an area, obstacle 0"),
        (lambda: Obstacles.hulls([SQUARE], -0.1), "must not be negative, got -0.1 m"),
        (lambda: Obstacles.hulls([SQUARE], [1.0, 2.0]), "got 1 cores and 2 radii"),
        (lambda: Obstacles.hulls(3.0, 1.0), "cores are a sequence of points .* got 3.0"),
        (lambda: Obstacles.hulls([SQUARE, [[0, 0, 0]]], 1.0), r"core 1 must have shape \(n, 2\)"),
        (lambda: Obstacles.polygons([[[0, 0], [1, 1]]], 1.0), "polygon 0 has no area; `capsules`"),
        (lambda: Obstacles.boxes([[0, 0]], [[1, 0]]), "an upper one above it"),
        (lambda: Obstacles.capsules([[0, 0], [1, 1]], 1.0), r"ends must have shape \(n, 2, n\)"),
    ],
)
def test_bad_cores_are_refused_in_a_sentence(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_fields_of_every_shape_are_json(tmp_path) -> None:
    obstacles = Obstacles.joined([Obstacles.polygons([SQUARE], 0.1), mixed(7)])
    free = obstacles.only(obstacles.signed_distance(np.zeros(2)) > 0.0)
    to_json(Field(name="town", obstacles=free), tmp_path / "town.json")
    read = from_json(tmp_path / "town.json").obstacles
    for name in ("points", "radii", "first"):
        np.testing.assert_array_equal(getattr(read, name), getattr(free, name))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ({"obstacles": {}}, r"obstacles must be a list of objects, got \{\}"),
        ({"obstacles": [3]}, "obstacle 0 must be an object with points and radius, got 3"),
        ({"obstacles": [{"points": SQUARE, "r": 1}]}, "obstacle 0 must be an object with points"),
        ({"obstacles": [{"points": []}]}, "core 0 has no points"),
        ({"obstacles": [{"points": [[1, 1]]}]}, "radii must be positive, got 0 m"),
        ({"obstacles": [{"points": [[-1, -1], [9, 0], [0, 9]]}]}, "start .* inside obstacle 0"),
        ({}, "a field needs centers and radii, or obstacles"),
    ],
)
def test_broken_shapes_are_named_with_their_file(tmp_path, text, message) -> None:
    (tmp_path / "town.json").write_text(json.dumps(text), encoding="utf-8")
    with pytest.raises(ValueError, match=rf"town\.json: .*{message}"):
        from_json(tmp_path / "town.json")


def test_discs_and_shapes_in_one_file_and_neither(tmp_path) -> None:
    file = tmp_path / "both.json"
    shapes = [{"points": SQUARE}, {"points": [[50, 50], [60, 50]], "radius": 2}]
    file.write_text(json.dumps({"centers": [[30, 30]], "radii": [4], "obstacles": shapes}))
    assert from_json(file).obstacles.radii.tolist() == [4.0, 0.0, 2.0]
    file.write_text(json.dumps({"obstacles": []}))
    assert len(from_json(file).obstacles) == 0
