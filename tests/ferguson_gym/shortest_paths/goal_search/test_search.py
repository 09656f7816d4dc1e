"""The search among many discs finds the paths that the graph of all tangents holds."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.shortest_paths.goal_search.class_search import LONGEST
from ferguson_gym.shortest_paths.homotopy_classes import classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Obstacles
from tests.support.taut_paths import (
    assert_is_taut,
    fields,
    from_graph,
    from_search,
    random_field,
    walls,
)


def assert_agrees(field: Field) -> ShortestPath | None:
    path, expected = from_search(field).path(field.start), from_graph(field).path(field.start)
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
    return Field(name=f"scattered {seed}", obstacles=Obstacles.discs(centers[free], radii[free]))


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
        obstacles=Obstacles.discs(centers, np.full(len(centers), 14.0 / rooms)),
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
    assert_agrees(
        Field(name="lattice", obstacles=Obstacles.discs(places, np.full(100, 5.0 * ratio)))
    )
    straight = Field(
        name="straight",
        obstacles=Obstacles.discs(places, np.full(100, 5.0 * ratio)),
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
    discs = Obstacles.discs(
        stream.uniform(-20.0, 120.0, (60, 2)), 10.0 ** stream.uniform(-1.0, 1.6, 60)
    )
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    free = (discs.signed_distance(ends) >= 0.0).all(axis=0)
    kept = Obstacles.discs(discs.centers[free], discs.radii[free])
    for bounds in ((-10.0, 110.0), (0.0, 100.0), (-3.0, 102.0)):
        assert_agrees(Field(name="sizes", obstacles=kept, bounds=bounds))


@given(field=fields())
@settings(deadline=None, max_examples=120, derandomize=True)
def test_in_any_field(field: Field) -> None:
    assert_agrees(field)


@given(wall=walls())
@settings(deadline=None, max_examples=30, derandomize=True)
def test_no_way_past_a_wall_from_bound_to_bound(wall: np.ndarray) -> None:
    closed = Obstacles.discs(wall[:, :2] + [40.0, 0.0], wall[:, 2])
    wide = Field(name="wall", obstacles=closed)
    assert from_search(wide).path(wide.start) is None
    centers = np.concatenate([closed.centers, closed.centers + np.array([10.0, 0.0])])
    two = Obstacles.discs(centers, np.tile(wall[:, 2], 2))
    wide = Field(name="walls", obstacles=two)
    assert from_search(wide).path(wide.start) is None


@pytest.mark.parametrize("depth", [-1e-3, 0.0, 1e-9, 1e-6, 9e-6])
@pytest.mark.parametrize("turn", np.linspace(0.0, 6.0, 9))
def test_from_points_within_the_tolerance(depth: float, turn: float) -> None:
    disc = Field(name="disc", obstacles=Obstacles.discs([[50.0, 50.0]], [20.0]))
    outward = np.array([math.cos(turn), math.sin(turn)])
    point = 50.0 + (20.0 - depth) * outward
    path, expected = from_search(disc).path(point), from_graph(disc).path(point)
    assert path is not None
    assert expected is not None
    assert path.length == pytest.approx(expected.length, rel=1e-9)
    assert_is_taut(path, disc, depth=max(depth, 0.0) + 2e-7)


def test_from_points_outside_the_bounds_by_the_tolerance_and_from_none_beyond() -> None:
    field = random_field(1, 12)
    togo, graph = from_search(field), from_graph(field)
    for point in ([-10.0 - 9e-6, 5.0], [5.0, 110.0 + 9e-6], [-10.0, -10.0], [-11.0, 5.0], [50, 50]):
        path, expected = togo.path(point), graph.path(point)
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
    mirrored = Obstacles.discs(field.obstacles.centers[:, ::-1], field.obstacles.radii)  # type: ignore[attr-defined]
    beside = shortest_path(Field(name="mirrored", obstacles=mirrored))
    assert beside is not None
    assert beside.length == pytest.approx(path.length, rel=1e-12)


def assert_agree_everywhere(field: Field, points: np.ndarray) -> None:
    """Queries in any order, each of which continues the same search, agree with the graph."""
    togo, graph = from_search(field), from_graph(field)
    distance, gradient = togo(points)
    expected, slope = graph(points)
    np.testing.assert_allclose(distance, expected, rtol=1e-9, atol=1e-9)
    # where the directions differ, two paths are equally short
    differ = np.flatnonzero(np.abs(gradient - slope).max(axis=1) > 1e-6)
    for k in differ:
        step = 1e-4 * np.stack([gradient[k], slope[k]])
        ahead = graph(points[k] - step)[0]
        np.testing.assert_allclose(ahead, expected[k] - 1e-4, atol=1e-8)
    assert len(differ) <= 0.05 * len(points)
    for point, length in zip(points[:20], distance[:20], strict=True):
        path = togo.path(point)
        assert (path is None) == (length == np.inf)
        if path is not None:
            assert path.length == pytest.approx(length, rel=1e-12)
            assert_is_taut(path, field, depth=2e-5)


@pytest.mark.parametrize(("least", "most"), [(0.05, 0.2), (0.2, 0.5), (0.3, 0.9), (0.05, 3.0)])
@pytest.mark.parametrize("number", [1, 30, 250])
def test_distances_from_points_anywhere(number: int, least: float, most: float) -> None:
    for seed in range(2):
        points = np.random.default_rng(seed).uniform(-12.0, 112.0, (150, 2))
        assert_agree_everywhere(scattered(seed, number, least, most), points)


def test_distances_from_points_anywhere_in_a_maze() -> None:
    points = np.random.default_rng(0).uniform(0.0, 100.0, (150, 2))
    assert_agree_everywhere(maze(0, 6), points)


def comb() -> Field:
    """Walls of overlapping discs from alternate bounds, so that the path winds between them."""
    wall = np.arange(-10.0, 91.0, 4.0)
    places = [
        (x, y if k % 2 == 0 else 100.0 - y)
        for k, x in enumerate(np.arange(12.0, 90.0, 12.0))
        for y in wall
    ]
    return Field(name="comb", obstacles=Obstacles.discs(places, np.full(len(places), 2.5)))


def spiral() -> Field:
    """A wall of overlapping discs that winds two and a half times around the goal."""
    turn = np.linspace(0.0, 5.0 * math.pi, 140)
    ray = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    centers = 50.0 + (6.0 + 2.6 * turn)[:, None] * ray
    # two of each, and a third that only touches
    radii = np.repeat([2.0, 2.0, 1.0], 140)
    centers = np.concatenate([centers, centers, centers + 3.0 * ray])
    return Field(name="spiral", obstacles=Obstacles.discs(centers, radii), goal=(50.0, 50.0))


@pytest.mark.parametrize("walls", [comb(), spiral()], ids=["comb", "spiral"])
def test_distances_and_classes_behind_walls(walls: Field) -> None:
    assert assert_agrees(walls) is not None
    points = np.random.default_rng(1).uniform(-10.0, 110.0, (50, 2))
    assert_agree_everywhere(walls, points)
    assert_same_classes(walls, walls.start, 3)


@given(field=fields())
@settings(deadline=None, max_examples=60, derandomize=True)
def test_distances_in_any_field(field: Field) -> None:
    discs = field.obstacles
    assert discs.are_discs
    around = np.stack([np.cos(np.arange(5.0)), np.sin(np.arange(5.0))], axis=-1)
    beside = (discs.centers[:, None] + discs.radii[:, None, None] * around).reshape(-1, 2)
    grid = np.stack(np.meshgrid(*2 * [np.arange(-10.0, 111.0, 12.0)]), axis=-1).reshape(-1, 2)
    togo, graph = from_search(field), from_graph(field)
    for points in (grid, beside, field.goal[None]):
        np.testing.assert_allclose(togo(points)[0], graph(points)[0], rtol=1e-9, atol=1e-9)


def assert_same_classes(field: Field, point: np.ndarray, number: int = 5) -> None:
    """The classes from the search are those from the graph, but for the longest."""
    expected = [path.length for path in classes(from_graph(field), point, number)]
    found = classes(from_search(field), point, number)
    lengths = [path.length for path in found]
    short = [length for length in expected if length <= (LONGEST - 1e-6) * expected[0]]
    np.testing.assert_allclose(lengths[: len(short)], short, rtol=1e-9)
    assert all(length <= LONGEST * lengths[0] * (1.0 + 1e-9) for length in lengths)
    for path in found:
        assert_is_taut(path, field, depth=2e-5)


@pytest.mark.parametrize("number", [5, 40, 250])
def test_classes_are_those_of_the_graph(number: int) -> None:
    for seed in range(3):
        field = scattered(seed, number, 0.1, 0.5)
        for point in np.random.default_rng(seed).uniform(0.0, 100.0, (4, 2)):
            if np.isfinite(from_graph(field)(point[None])[0][0]):
                assert_same_classes(field, point)


@given(field=fields(most=8))
@settings(deadline=None, max_examples=60, derandomize=True)
def test_classes_in_any_field(field: Field) -> None:
    if from_graph(field).path(field.start) is not None:
        assert_same_classes(field, field.start, 4)


def test_classes_from_the_goal_and_from_inside_a_disc() -> None:
    togo = from_search(scattered(0, 40, 0.2, 0.5))
    (path,) = classes(togo, togo.field.goal, 3)
    assert path.length == 0.0
    assert classes(togo, togo.field.obstacles.centers[0], 3) == []  # type: ignore[attr-defined]


def test_a_search_lost_to_an_interrupt_is_begun_again() -> None:
    field = scattered(0, 250, 0.2, 0.5)
    togo = from_search(field)
    (before,), _ = togo(field.start[None])
    togo.borrow()
    (after,), _ = togo(field.start[None])
    assert after == before
    assert len(togo.searches) == 1


def test_a_query_near_an_earlier_one_makes_few_tangents() -> None:
    field = scattered(0, 5000, 0.2, 0.5)
    togo = from_search(field)
    path = togo.path(field.start)
    assert path is not None
    made = togo.searches[0].sizes[0]
    togo(path.points(0.25)[::20])
    assert togo.searches[0].sizes[0] <= 1.5 * made
    assert made < 5 * len(field.obstacles)
