"""Properties of the shortest path that hold in every field: taut, symmetric, monotone, scaled."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from ferguson_gym.shortest_paths.exact import exact_length, shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Obstacles
from tests.support.taut_paths import assert_is_taut, field_of, fields, found, random_field, walls


@pytest.mark.parametrize("suite", ["standard", "sparse", "dense", "forest", "traps"])
def test_paths_through_the_suites_are_taut_and_the_same_both_ways(suite: str) -> None:
    for field in get_fields(f"{suite}/validation:0-9"):
        assert field.obstacles.are_discs
        discs = field.obstacles
        length = found(field).length
        assert length >= field.distance
        back = Field(name="back", obstacles=discs, start=field.goal, goal=field.start)
        assert found(back).length == pytest.approx(length, rel=1e-12)
        turned = Obstacles.discs(discs.centers[:, ::-1] * [-1.0, 1.0], discs.radii)
        quarter = Field(
            name="t", obstacles=turned, goal=(-100.0, 100.0), bounds=[[-110, -10], [10, 110]]
        )
        assert found(quarter).length == pytest.approx(length, rel=1e-12)
        mirrored = Field(
            name="mirrored", obstacles=Obstacles.discs(discs.centers[:, ::-1], discs.radii)
        )
        assert found(mirrored).length == pytest.approx(length, rel=1e-12)
        order = np.random.default_rng(0).permutation(len(discs))
        mixed = Field(
            name="mixed", obstacles=Obstacles.discs(discs.centers[order], discs.radii[order])
        )
        assert found(mixed).length == pytest.approx(length, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_lengths_scale_with_the_field(scale: float) -> None:
    for seed in range(5):
        field = random_field(seed, 12)
        discs = field.obstacles
        assert discs.are_discs
        length = exact_length(field)
        scaled = Field(
            name="scaled",
            obstacles=Obstacles.discs(scale * discs.centers + 7.0, scale * discs.radii),
            start=scale * field.start + 7.0,
            goal=scale * field.goal + 7.0,
            bounds=scale * field.bounds + 7.0,
        )
        expected = None if length is None else pytest.approx(scale * length, rel=1e-9)
        assert exact_length(scaled) == expected


def among_polygons(field: Field, corners: int, outside: bool) -> float:
    """Shortest path among polygons in the place of discs, by visibility between all corners."""
    discs = field.obstacles
    assert discs.are_discs
    half = np.pi / corners
    turn = 2.0 * half * np.arange(corners) + 0.1
    normals = np.stack([np.cos(turn + half), np.sin(turn + half)], axis=1)
    inner = discs.radii * (1.0 if outside else math.cos(half))  # radius of the inscribed circle
    outer = inner / math.cos(half)
    corner = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = (discs.centers[:, None] + outer[:, None, None] * corner).reshape(-1, 2)
    inside = ((points >= field.bounds[0]) & (points <= field.bounds[1])).all(axis=1)
    # how far in front of each polygon's edges (points, discs, edges)
    ahead = (points[:, None] - discs.centers) @ normals.T - inner[:, None]
    points = points[inside & ~(ahead < -1e-9).all(axis=2).any(axis=1)]
    points = np.concatenate([[field.start, field.goal], points])
    ahead = (points[:, None] - discs.centers) @ normals.T - inner[:, None] + 1e-9
    i, j = np.triu_indices(len(points), 1)
    free = np.ones(len(i), dtype=bool)
    for disc in range(len(discs)):
        a, b = ahead[i, disc], ahead[j, disc]
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = a / (a - b)
        enter = np.where(a > 0.0, np.where(b > 0.0, 2.0, zero), 0.0).max(axis=1)
        leave = np.where(b > 0.0, np.where(a > 0.0, -1.0, zero), 1.0).min(axis=1)
        free &= enter >= leave
    graph = np.zeros((len(points), len(points)))
    graph[i, j] = np.where(free, np.linalg.norm(points[i] - points[j], axis=1), 0.0)
    return float(dijkstra(graph, directed=False, indices=0)[1])


@pytest.mark.parametrize("seed", range(12))
def test_the_length_lies_between_those_among_smaller_and_larger_polygons(seed: int) -> None:
    field = random_field(seed, 3 + seed // 2, largest=25.0)
    least, most = (among_polygons(field, 40, outside) for outside in (False, True))
    exact = exact_length(field)
    if exact is None:
        assert most == math.inf
    else:
        assert least - 1e-6 <= exact <= most + 1e-6
        assert least > 0.98 * exact


@pytest.mark.parametrize("seed", range(60))
def test_among_discs_of_all_sizes_the_path_is_taut(seed: int) -> None:
    stream = np.random.default_rng(seed)
    discs = Obstacles.discs(
        stream.uniform(-20.0, 120.0, (30, 2)), 10.0 ** stream.uniform(-1.0, 1.6, 30)
    )
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    free = (discs.signed_distance(ends) >= 0.0).all(axis=0)
    field = Field(name="sizes", obstacles=Obstacles.discs(discs.centers[free], discs.radii[free]))
    path = shortest_path(field)
    if path is not None:
        assert_is_taut(path, field)


@given(field=fields())
@settings(deadline=None, max_examples=200, derandomize=True)
def test_in_any_field_the_path_is_taut_and_as_long_as_the_way_back(field: Field) -> None:
    path = shortest_path(field)
    back = exact_length(
        Field(name="back", obstacles=field.obstacles, start=field.goal, goal=field.start)
    )
    if path is None:
        assert back is None
    else:
        assert_is_taut(path, field)
        assert back == pytest.approx(path.length, abs=1e-6)
        assert path.length >= field.distance * (1.0 - 1e-12)


@given(walls=st.lists(walls(), min_size=1, max_size=4))
@settings(deadline=None, max_examples=60, derandomize=True)
def test_walls_from_bound_to_bound_leave_no_path_and_a_hole_in_each_does(
    walls: list[np.ndarray],
) -> None:
    shifts = [np.array([30.0 + 15.0 * k, 0.0, 0.0]) for k in range(len(walls))]
    closed = np.concatenate([wall + shift for wall, shift in zip(walls, shifts, strict=True)])
    assert shortest_path(field_of(closed[:, :2], closed[:, 2])) is None
    turned = field_of(closed[:, 1::-1], closed[:, 2])
    assert shortest_path(turned) is None
    with_hole = [np.delete(wall, len(wall) // 2 + np.arange(-3, 4), axis=0) for wall in walls]
    holes = np.concatenate([wall + shift for wall, shift in zip(with_hole, shifts, strict=True)])
    found(field_of(holes[:, :2], holes[:, 2]))


@given(field=fields(), cut=st.sampled_from([2.5, 5.0, 7.5, 10.0]))
@settings(deadline=None, max_examples=150, derandomize=True)
def test_with_bounds_that_cut_discs_the_path_stays_inside(field: Field, cut: float) -> None:
    # start and goal lie in corners of the bounds, and many discs stick out of them equally far
    narrow = Field(name="cut", obstacles=field.obstacles, bounds=(0.0, 100.0))
    path = shortest_path(narrow)
    wider = Field(name="wider", obstacles=field.obstacles, bounds=(-cut, 100.0 + cut))
    longest = math.inf if path is None else path.length
    assert (exact_length(wider) or math.inf) <= longest + 1e-6
    if path is not None:
        assert_is_taut(path, narrow)


@given(field=fields())
@settings(deadline=None, max_examples=100, derandomize=True)
def test_a_disc_more_never_shortens_the_path(field: Field) -> None:
    discs = field.obstacles
    assert discs.are_discs
    longer = exact_length(field) or math.inf
    fewer = Field(name="fewer", obstacles=Obstacles.discs(discs.centers[:-1], discs.radii[:-1]))
    assert (exact_length(fewer) or math.inf) <= longer + 1e-6
