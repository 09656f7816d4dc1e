"""Graphs of a part of the obstacles give what the graph of all gives, and hold few obstacles."""

import numpy as np
import pytest

from ferguson_gym.shortest_paths.distance_to_goal import FEW, DistanceToGoal
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.shortest_paths.homotopy_classes import classes
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Obstacles
from tests.support.taut_paths import from_graph
from tests.support.visibility import random_mixture, random_polygons, visibility_lengths


def many(seed: int, number: int = 300) -> Field:
    """More small obstacles of all shapes than the graph of all is made for."""
    stream = np.random.default_rng(seed)
    cores, radii = [], []
    for k in range(number):
        corners = (1, 2, 3, 5, 8)[k % 5]
        turn = 2.0 * np.pi * (np.arange(corners) + stream.uniform(0.0, 0.8, corners)) / corners
        circle = stream.uniform(0.5, 4.0) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        cores.append(stream.uniform(-10.0, 110.0, 2) + (circle if corners > 1 else 0.0 * circle))
        radii.append(stream.uniform(0.2, 3.0) if corners < 3 or k % 2 else 0.0)
    every = Obstacles.hulls(cores, radii)
    free = (every.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])) > 0.0).all(axis=0)
    return Field(name=f"many {seed}", obstacles=every.only(free))


def from_part(field: Field) -> DistanceToGoal:
    return DistanceToGoal(field, for_few_queries=True)


def assert_agree(part: DistanceToGoal, points: np.ndarray) -> None:
    """Queries in any order, one by one and at once, agree with the graph of all obstacles."""
    whole = from_graph(part.field)
    expected, slope = whole(points)
    for point, length in zip(points[:8], expected[:8], strict=True):
        path = part.path(point)
        assert (path is None) == np.isinf(length)
        if path is not None:
            same = whole.path(point)
            assert same is not None
            assert path.length == pytest.approx(length, rel=1e-9, abs=1e-9)
            np.testing.assert_allclose(path.points(1.0)[-1], same.points(1.0)[-1])
            np.testing.assert_array_equal(np.sort(path.discs), np.sort(same.discs))
    lengths, gradient = part(points)
    np.testing.assert_allclose(lengths, expected, rtol=1e-9, atol=1e-9)
    assert (np.abs(gradient - slope).max(axis=1) > 1e-6).mean() <= 0.05


@pytest.mark.parametrize("seed", range(12))
def test_distances_and_paths_from_points_anywhere(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-10.0, 110.0, (40, 2))
    assert_agree(from_part(random_mixture(seed)), points)
    assert_agree(from_part(random_polygons(seed, 25, 5, 12.0)), points)


@pytest.mark.parametrize("suite", ["town", "walls"])
def test_lengths_in_the_suites(suite: str) -> None:
    for field in get_fields(f"{suite}/train:0-11"):
        path = from_graph(field).path(field.start)
        assert path is not None
        assert exact_length(field) == pytest.approx(path.length, rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_lengths_among_polygons_are_those_of_a_visibility_graph(seed: int) -> None:
    field = random_polygons(seed, 30, 4, 10.0)
    expected = visibility_lengths(field, [field.start])[0]
    length = exact_length(field)
    assert (np.inf if length is None else length) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_among_many_obstacles_the_first_query_needs_a_part_of_them(seed: int) -> None:
    field = many(seed)
    assert len(field.obstacles) > FEW
    togo = DistanceToGoal(field)
    assert togo.tracks is None
    path = togo.path(field.start)
    assert path is not None
    (graph,) = togo.graphs
    assert len(graph.kept) < 0.7 * len(field.obstacles)
    # points near the path need no other obstacles
    togo(path.points(2.0) + np.random.default_rng(seed).normal(0.0, 0.2, path.points(2.0).shape))
    assert togo.graphs[0] is graph
    assert_agree(togo, np.random.default_rng(seed).uniform(-10.0, 110.0, (30, 2)))


@pytest.mark.parametrize("seed", range(8))
def test_classes_are_those_of_the_graph_of_all(seed: int) -> None:
    field = random_mixture(seed)
    expected = classes(from_graph(field), field.start, 6)
    found = classes(from_part(field), field.start, 6)
    assert [len(path.discs) for path in found] == [len(path.discs) for path in expected]
    np.testing.assert_allclose(
        [path.length for path in found], [path.length for path in expected], rtol=1e-9
    )


def test_classes_among_many_obstacles() -> None:
    field = many(0)
    expected = [path.length for path in classes(from_graph(field), field.start, 3)]
    found = [path.length for path in classes(DistanceToGoal(field), field.start, 3)]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_no_path_from_within_obstacles_and_rings() -> None:
    walls = [[[20, 20], [80, 20]], [[80, 20], [80, 80]], [[80, 80], [20, 80]], [[20, 80], [20, 20]]]
    ring = Obstacles.capsules(np.array(walls, dtype=float), 0.5)
    specks = Obstacles.boxes([[95.0, 5.0]], [[96.0, 6.0]])
    field = Field(name="ring", obstacles=Obstacles.joined([ring, specks]))
    togo = from_part(field)
    inside, outside = [50.0, 50.0], [0.0, 110.0]
    assert togo.path(inside) is None
    assert togo.path([95.5, 5.5]) is None
    assert np.isinf(togo([inside, [80.0, 50.0], [200.0, 0.0]])[0]).all()
    assert togo.path(outside) is not None
    assert classes(togo, inside, 3) == []
    assert togo([field.goal])[0][0] == 0.0


def test_without_points_and_far_from_all_obstacles() -> None:
    field = Field(name="far", obstacles=Obstacles.boxes([[95.0, 5.0]], [[96.0, 6.0]]))
    togo = from_part(field)
    distances, gradient = togo(np.empty((0, 2)))
    assert distances.shape == (0,)
    assert gradient.shape == (0, 2)
    assert exact_length(field) == pytest.approx(np.sqrt(2.0) * 100.0)
    assert togo([[100.0, -5.0]])[0][0] == pytest.approx(105.0)
    assert togo([[95.5, 0.0]])[0][0] > np.hypot(4.5, 100.0)
    assert len(togo.graphs[0].kept) == 1
