"""The search among many discs finds the paths that the graph of all tangents holds."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from ferguson_gym.shortest_paths import exact
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import path_from, shortest_path
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Discs
from tests.support.taut_paths import assert_is_taut, fields, random_field, walls


@pytest.fixture(autouse=True)
def _few_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search is used for every field."""
    monkeypatch.setattr(exact, "FEW", -1)


def assert_agrees(field: Field) -> ShortestPath | None:
    path, expected = shortest_path(field), DistanceToGoal(field).path(field.start)
    if expected is None:
        assert path is None
        return None
    assert path is not None
    assert path.length == pytest.approx(expected.length, rel=1e-9)
    assert_is_taut(path, field)
    np.testing.assert_array_equal(path.lines[0, 0], field.start)
    return path


def scattered(seed: int, number: int, least: float, most: float) -> Field:
    """Discs at random; radii from `least` to `most` times their mean distance."""
    stream = np.random.default_rng(seed)
    spacing = 120.0 / math.sqrt(number)
    centers = stream.uniform(-10.0, 110.0, (number, 2))
    radii = stream.uniform(least, most, number) * spacing
    apart = np.linalg.norm(centers[:, None] - [[0.0, 0.0], [100.0, 100.0]], axis=-1)
    free = (apart >= radii[:, None]).all(axis=1)
    return Field(name=f"scattered {seed}", obstacles=Discs(centers[free], radii[free]))


def maze(seed: int, rooms: int) -> Field:
    """A maze of walls of overlapping discs, with a few more doors than it needs."""
    stream = np.random.default_rng(seed)
    right, up = np.ones((2, rooms, rooms), dtype=bool)
    seen, way = {(0, 0)}, [(0, 0)]
    while way:
        i, j = way[-1]
        near = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
        new = [
            (a, b) for a, b in near if 0 <= min(a, b) <= max(a, b) < rooms and (a, b) not in seen
        ]
        if not new:
            way.pop()
            continue
        a, b = new[stream.integers(len(new))]
        (right if a != i else up)[min(a, i), min(b, j)] = False
        seen.add((a, b))
        way.append((a, b))
    right &= stream.uniform(size=right.shape) > 0.05
    places = [
        at
        for i in range(rooms)
        for j in range(rooms)
        for k in range(5)
        for wall, at in (
            (right[i, j], (i + 1.0, j + k / 4.0)),
            (up[i, j], (i + k / 4.0, j + 1.0)),
        )
        if wall
    ]
    centers = np.unique(np.array(places), axis=0) * 100.0 / rooms
    half = 50.0 / rooms
    return Field(
        name="maze",
        obstacles=Discs(centers, np.full(len(centers), 14.0 / rooms)),
        start=(half, half),
        goal=(100.0 - half, 100.0 - half),
        bounds=(0.0, 100.0),
    )


@pytest.mark.parametrize("suite", ["standard", "sparse", "dense", "forest", "traps"])
def test_in_the_suites(suite: str) -> None:
    for field in get_fields(f"{suite}/validation:0-9"):
        assert assert_agrees(field) is not None


@pytest.mark.parametrize(("least", "most"), [(0.1, 0.3), (0.2, 0.5), (0.3, 0.9), (0.05, 3.0)])
@pytest.mark.parametrize("number", [1, 3, 10, 30, 100, 300])
def test_among_scattered_discs(number: int, least: float, most: float) -> None:
    for seed in range(3):
        assert_agrees(scattered(seed, number, least, most))


@pytest.mark.parametrize("rooms", [2, 4, 8])
def test_in_mazes(rooms: int) -> None:
    for seed in range(3):
        assert assert_agrees(maze(seed, rooms)) is not None


@pytest.mark.parametrize("ratio", [0.3, 0.7, 0.99, 1.0, 1.05])
def test_in_lattices(ratio: float) -> None:
    # lines along the axes and the diagonals lie on the borders of sectors; discs touch at 1
    places = np.stack(np.meshgrid(*2 * [np.arange(5.0, 100.0, 10.0)]), axis=-1).reshape(-1, 2)
    assert_agrees(Field(name="lattice", obstacles=Discs(places, np.full(100, 5.0 * ratio))))
    straight = Field(
        name="straight",
        obstacles=Discs(places, np.full(100, 5.0 * ratio)),
        start=(0.0, 50.0),
        goal=(100.0, 50.0),
    )
    path = assert_agrees(straight)
    if ratio < 1.0:
        assert path is not None
        assert path.length == 100.0


@pytest.mark.parametrize("seed", range(30))
def test_among_discs_of_all_sizes_that_bounds_cut(seed: int) -> None:
    stream = np.random.default_rng(seed)
    discs = Discs(stream.uniform(-20.0, 120.0, (60, 2)), 10.0 ** stream.uniform(-1.0, 1.6, 60))
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    free = (discs.signed_distance(ends) >= 0.0).all(axis=0)
    kept = Discs(discs.centers[free], discs.radii[free])
    for bounds in ((-10.0, 110.0), (0.0, 100.0), (-3.0, 102.0)):
        assert_agrees(Field(name="sizes", obstacles=kept, bounds=bounds))


@given(field=fields())
@settings(deadline=None, max_examples=120, derandomize=True)
def test_in_any_field(field: Field) -> None:
    assert_agrees(field)


@given(wall=walls())
@settings(deadline=None, max_examples=30, derandomize=True)
def test_no_way_past_a_wall_from_bound_to_bound(wall: np.ndarray) -> None:
    closed = Discs(wall[:, :2] + [40.0, 0.0], wall[:, 2])
    assert shortest_path(Field(name="wall", obstacles=closed)) is None
    centers = np.concatenate([closed.centers, closed.centers + np.array([10.0, 0.0])])
    two = Discs(centers, np.tile(wall[:, 2], 2))
    assert shortest_path(Field(name="walls", obstacles=two)) is None


@pytest.mark.parametrize("depth", [-1e-3, 0.0, 1e-9, 1e-6, 9e-6])
@pytest.mark.parametrize("turn", np.linspace(0.0, 6.0, 9))
def test_from_points_within_the_tolerance(depth: float, turn: float) -> None:
    disc = Field(name="disc", obstacles=Discs([[50.0, 50.0]], [20.0]))
    outward = np.array([math.cos(turn), math.sin(turn)])
    point = 50.0 + (20.0 - depth) * outward
    path, expected = path_from(disc, point), DistanceToGoal(disc).path(point)
    assert path is not None
    assert expected is not None
    assert path.length == pytest.approx(expected.length, rel=1e-9)
    assert_is_taut(path, disc, depth=max(depth, 0.0) + 2e-7)


def test_from_points_outside_the_bounds_by_the_tolerance_and_from_none_beyond() -> None:
    field = random_field(1, 12)
    togo = DistanceToGoal(field)
    for point in ([-10.0 - 9e-6, 5.0], [5.0, 110.0 + 9e-6], [-10.0, -10.0], [-11.0, 5.0], [50, 50]):
        path, expected = path_from(field, point), togo.path(point)
        assert (path is None) == (expected is None)
        if path is not None and expected is not None:
            assert path.length == pytest.approx(expected.length, rel=1e-9)


def test_among_thousands_of_discs_the_path_is_taut_and_the_same_both_ways() -> None:
    field = scattered(0, 5000, 0.2, 0.5)
    path = shortest_path(field)
    assert path is not None
    assert_is_taut(path, field)
    back = Field(name="back", obstacles=field.obstacles, start=field.goal, goal=field.start)
    there = shortest_path(back)
    assert there is not None
    assert there.length == pytest.approx(path.length, rel=1e-12)
    mirrored = Discs(field.obstacles.centers[:, ::-1], field.obstacles.radii)  # type: ignore[attr-defined]
    beside = shortest_path(Field(name="mirrored", obstacles=mirrored))
    assert beside is not None
    assert beside.length == pytest.approx(path.length, rel=1e-12)
