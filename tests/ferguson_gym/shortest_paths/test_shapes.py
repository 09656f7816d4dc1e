"""Exact paths among every shape, against a plain visibility graph and known lengths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import exact_length, shortest_path
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.scaled_fields import MOTIONS, Motion
from tests.support.visibility import random_mixture, random_polygons, visibility_lengths

OPEN = (-50.0, 150.0)


def field_of(obstacles: Obstacles, start: Sequence[float], goal: Sequence[float]) -> Field:
    return Field(name="shapes", obstacles=obstacles, start=start, goal=goal, bounds=OPEN)


def free_points(field: Field, number: int, seed: int = 0) -> np.ndarray:
    """Points in the open, on boundaries and on corners."""
    stream, every = np.random.default_rng(seed), field.obstacles
    points = stream.uniform(*field.bounds, (number, 2))
    if not len(every):
        return points
    distance, gradient = every.signed_distance(points), every.gradient(points)
    nearest, rows = np.abs(distance).argmin(axis=1), np.arange(number)
    moved = points - distance[rows, nearest, None] * gradient[rows, nearest]
    corners = every.points[stream.integers(len(every.points), size=number // 4)]
    points = np.concatenate([points[: number // 2], moved[number // 2 :], corners])
    inside = ((points >= field.bounds[0]) & (points <= field.bounds[1])).all(axis=1)
    return points[inside & (every.signed_distance(points).min(axis=1) >= -1e-9)]


def assert_is_a_path(path: ShortestPath, field: Field, point: np.ndarray) -> None:
    """Its pieces join without a corner, enter no obstacle and add up."""
    spans = path.lines[:, 1] - path.lines[:, 0]
    long = np.linalg.norm(spans, axis=1)
    assert long.sum() + path.radii @ path.sweeps == pytest.approx(path.length, rel=1e-9, abs=1e-9)
    np.testing.assert_allclose(path.lines[0, 0], point, atol=1e-6)
    np.testing.assert_array_equal(path.lines[-1, 1], field.goal)
    np.testing.assert_array_equal(path.radii, field.obstacles.radii[path.discs])
    for k, (obstacle, center) in enumerate(zip(path.discs, path.centers, strict=True)):
        assert (field.obstacles.core(obstacle) == center).all(axis=1).any()
        for at, line in ((path.angles[k, 0], k), (path.angles[k, 1], k + 1)):
            way = path.senses[k] * np.array([-np.sin(at), np.cos(at)])
            assert way @ spans[line] >= long[line] * (1.0 - 1e-9) - 1e-6
    assert (path.senses * (path.angles[:, 1] - path.angles[:, 0]) >= -1e-12).all()
    points = path.points(0.25)
    assert (points >= field.bounds[0] - 2e-7).all()
    assert (points <= field.bounds[1] + 2e-7).all()
    if len(field.obstacles):
        least = path.radii[path.radii > 0.0].min(initial=np.inf)
        assert field.obstacles.signed_distance(points).min() >= -2e-7 - 0.25**2 / (8.0 * least)


@pytest.mark.parametrize("seed", range(24))
def test_lengths_among_polygons_are_those_of_a_visibility_graph(seed: int) -> None:
    number, sides, largest = 3 + 2 * (seed % 13), 3 + seed % 6, (5.0, 20.0, 40.0)[seed % 3]
    field = random_polygons(seed, number, sides, largest)
    points, togo = free_points(field, 12), DistanceToGoal(field)
    lengths, gradient = togo(points)
    np.testing.assert_allclose(lengths, visibility_lengths(field, points), rtol=1e-9, atol=1e-12)
    for point, length, slope in zip(points, lengths, gradient, strict=True):
        path = togo.path(point)
        assert (path is None) == np.isinf(length)
        if path is not None:
            assert path.length == length
            assert_is_a_path(path, field, point)
            first = path.lines[0, 1] - path.lines[0, 0]
            np.testing.assert_allclose(first, -np.linalg.norm(first) * slope, atol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_lengths_among_mixtures_lie_between_those_of_polygons_within_and_around(seed: int) -> None:
    field = random_mixture(seed)
    points, togo = free_points(field, 8), DistanceToGoal(field)
    lengths, gradient = togo(points)
    assert (lengths >= visibility_lengths(field, points, 40) - 1e-6).all()
    assert (lengths <= visibility_lengths(field, points, 40, around=True) + 1e-6).all()
    for point, length, slope in zip(points, lengths, gradient, strict=True):
        back = Field(name="back", obstacles=field.obstacles, start=field.goal, goal=point)
        reverse = exact_length(back)
        if (path := togo.path(point)) is None:
            assert reverse is None
            continue
        assert reverse == pytest.approx(length, rel=1e-8)
        assert_is_a_path(path, field, point)
        first = path.lines[0, 1] - path.lines[0, 0]
        np.testing.assert_allclose(first, -np.linalg.norm(first) * slope, atol=1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_lengths_in_grids_with_ends_on_corners_are_those_of_a_visibility_graph(seed: int) -> None:
    stream = np.random.default_rng(seed)
    number = int(stream.integers(3, 9))
    step, turn = 100.0 / number, (0.0, 0.0, 0.3, 0.25 * np.pi)[seed % 4]
    cells = np.argwhere(stream.random((number, number)) < (0.2, 0.4, 0.55)[seed % 3])
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    # some cells overlap their neighbours, some are there twice, some are only half there
    wide = stream.choice([1.0, 1.0, 2.0], len(cells))
    cores = [step * (cell + size * ring) for cell, size in zip(cells, wide, strict=True)]
    cores = [*cores, *cores[:2], *(core[stream.permutation(4)[:3]] for core in cores[2:6])]
    lattice = step * np.stack(np.meshgrid(*2 * [np.arange(number + 1)]), axis=-1).reshape(-1, 2)
    straight = Obstacles.polygons(cores)
    free = lattice[straight.signed_distance(lattice).min(axis=1) >= -1e-12]
    ends = free[stream.permutation(len(free))[:8]]
    middles = 0.5 * (ends[:-1] + ends[1:])
    points = np.concatenate([ends, middles[straight.are_free(middles[:, None])]])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    every = Obstacles.polygons([core @ rotation.T for core in cores])
    points = points @ rotation.T
    low, high = every.points.min(axis=0) - 30.0, every.points.max(axis=0) + 30.0
    bounds = np.stack([np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))])
    field = Field(name="grid", obstacles=every, start=points[1], goal=points[0], bounds=bounds)
    lengths, _ = DistanceToGoal(field)(points[1:])
    expected = visibility_lengths(field, points[1:])
    np.testing.assert_allclose(lengths, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_lengths_move_with_the_field(seed: int, motion: Motion) -> None:
    field = random_mixture(seed)
    length, image = exact_length(field), exact_length(motion.field(field))
    assert (length is None) == (image is None)
    if length is not None:
        assert image == pytest.approx(motion.scale * length, rel=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_discs_are_the_same_beside_another_shape(seed: int) -> None:
    discs = random_mixture(seed, shapes=False).obstacles
    alone = Field(name="discs", obstacles=discs)
    speck = Obstacles.boxes([[-9.9, 109.8]], [[-9.8, 109.9]])
    beside = Field(name="beside", obstacles=Obstacles.joined([discs, speck]))
    points = free_points(alone, 20)
    one, other = DistanceToGoal(alone), DistanceToGoal(beside)
    np.testing.assert_allclose(other(points)[0], one(points)[0], rtol=1e-12)


def test_obstacles_within_others_and_copies_change_nothing() -> None:
    wide = [[40.0, 20.0], [60.0, 20.0], [60.0, 90.0], [40.0, 90.0]]
    inner = [[45.0, 30.0], [60.0, 30.0], [60.0, 50.0], [45.0, 40.0]]
    alone = field_of(Obstacles.polygons([wide]), (0, 50), (100, 52))
    every = field_of(Obstacles.polygons([inner, wide, wide]), (0, 50), (100, 52))
    assert exact_length(alone) == exact_length(every)
    path = shortest_path(every)
    assert path is not None
    assert path.discs.tolist() == [1, 1]


def test_around_a_square_with_and_without_rounded_corners() -> None:
    for radius in (0.0, 3.0):
        square = Obstacles.boxes([[40.0, 40.0]], [[60.0, 60.0]], radius)
        path = shortest_path(field_of(square, (40.0 - radius, 50.0), (60.0 + radius, 50.0)))
        assert path is not None
        assert path.length == pytest.approx(40.0 + math.pi * radius, rel=1e-12)
        assert path.discs.tolist() == [0, 0]
        assert path.sweeps.sum() == pytest.approx(math.pi)


def test_around_a_capsule() -> None:
    wall = Obstacles.capsules([[[50.0, 20.0], [50.0, 70.0]]], 5.0)
    length = exact_length(field_of(wall, (45.0, 50.0), (55.0, 50.0)))
    assert length == pytest.approx(40.0 + 5.0 * math.pi, rel=1e-12)


@pytest.mark.parametrize("overlap", [-1e-9, 0.0, 1e-9, 1e-6, 1.0])
def test_a_seam_between_obstacles_is_a_way_until_they_overlap(overlap: float) -> None:
    # a wall of two rectangles that touch along an edge of 20 m
    low, high = [[40.0, -60.0], [40.0, 50.0 - overlap]], [[60.0, 50.0], [60.0, 160.0]]
    length = exact_length(field_of(Obstacles.boxes(low, high), (0, 50), (100, 50)))
    assert length == (None if overlap > 1e-7 else pytest.approx(100.0, rel=1e-9))


def test_between_squares_that_touch_at_a_corner() -> None:
    squares = Obstacles.boxes([[20.0, 20.0], [50.0, 50.0]], [[50.0, 50.0], [80.0, 80.0]])
    length = exact_length(field_of(squares, (70.0, 30.0), (30.0, 70.0)))
    assert length == pytest.approx(math.hypot(40.0, 40.0), rel=1e-12)


def test_a_cross_of_two_bars_has_more_than_two_common_tangents() -> None:
    cross = Obstacles.boxes([[20.0, 45.0], [45.0, 20.0]], [[80.0, 55.0], [55.0, 80.0]])
    field = field_of(cross, (44.0, 44.0), (56.0, 56.0))
    assert visibility_lengths(field, [field.start])[0] == pytest.approx(exact_length(field))
    path = shortest_path(field)
    assert path is not None
    assert set(path.discs.tolist()) == {0, 1}


def test_a_start_inside_by_the_tolerance_is_free_and_one_deeper_is_not() -> None:
    square = Obstacles.boxes([[40.0, 40.0]], [[60.0, 60.0]])
    field = field_of(square, (0.0, 50.0), (100.0, 50.0))
    togo = DistanceToGoal(field)
    for depth in (0.0, 1e-9, 9e-6):
        points = [[40.0 + depth, 50.0], [50.0, 40.0 + depth], [40.0 + depth, 40.0 + depth]]
        lengths, gradient = togo(points)
        expected = [10.0 + 20.0 + math.hypot(40.0, 10.0), 10.0 + math.hypot(40.0, 10.0)]
        np.testing.assert_allclose(lengths[:2], expected, atol=1e-4)
        assert lengths[2] == pytest.approx(20.0 + math.hypot(40.0, 10.0), abs=1e-4)
        np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, rtol=1e-12)
    assert np.isinf(togo([[40.0 + 2e-5, 50.0], [50.0, 50.0]])[0]).all()


def test_a_closed_ring_has_no_path() -> None:
    walls = [[[20, 20], [80, 20]], [[80, 20], [80, 80]], [[80, 80], [20, 80]], [[20, 80], [20, 20]]]
    ring = Obstacles.capsules(np.array(walls, dtype=float), 0.5)
    assert exact_length(field_of(ring, (50, 50), (100, 100))) is None
    open_ring = Obstacles.capsules(np.array(walls[:3], dtype=float), 0.5)
    assert exact_length(field_of(open_ring, (50, 50), (100, 100))) is not None
