"""Homotopy classes among obstacles of every shape: each once, without loops, the best one first."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.homotopy_classes import best_classes, classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.visibility import random_mixture, random_polygons


def same(one: ShortestPath, other: ShortestPath) -> bool:
    """Whether two paths never are a millimetre apart."""
    ways = [path.at(np.linspace(0.0, one.length, 400)) for path in (one, other)]
    return bool(np.abs(ways[0] - ways[1]).max() < 1e-3)


FIELDS = [
    *(get_field(f"{suite}/validation:{k}") for suite in ("town", "walls") for k in (6, 9)),
    *(random_mixture(seed) for seed in range(3)),
    *(random_polygons(seed, 14) for seed in range(3)),
]


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_classes_are_different_paths_and_the_best_is_the_shortest_path(field: Field) -> None:
    togo = DistanceToGoal(field)
    found, path = classes(togo, field.start, 6), togo.path(field.start)
    assert path is not None
    assert found[0].length == pytest.approx(path.length, rel=1e-12)
    lengths = [one.length for one in found]
    assert lengths == sorted(lengths)
    assert not any(same(one, other) for one, other in combinations(found, 2))
    for one in found:
        spans = np.linalg.norm(one.lines[:, 1] - one.lines[:, 0], axis=1)
        assert spans.sum() + one.radii @ one.sweeps == pytest.approx(one.length, rel=1e-9)
        # between points of an arc chords cut into obstacles
        assert field.obstacles.signed_distance(one.points(0.05)).min() >= -2e-3


@pytest.mark.parametrize("radius", [0.0, 2.0])
def test_around_one_obstacle_there_are_two_classes(radius: float) -> None:
    hexagon = 50.0 + 20.0 * np.stack([np.cos(np.arange(6)), np.sin(np.arange(6))], axis=1)
    field = Field(name="one", obstacles=Obstacles.polygons([hexagon], radius))
    found = best_classes(field, field.start, 10)
    assert [set(path.senses.tolist()) for path in found] in ([{1}, {-1}], [{-1}, {1}])
    if radius == 0.0:
        # from a corner that does not see the goal, and from one that does
        assert len(best_classes(field, field.obstacles.points[1], 10)) == 2
        best = best_classes(field, field.obstacles.points[4], 10)[0]
        assert best.length == np.linalg.norm(field.goal - field.obstacles.points[4])


def test_corners_and_edges_that_obstacles_share_make_no_copies() -> None:
    # an L of two rectangles with a common corner and a common part of an edge
    low, high = [[40.0, 40.0], [40.0, 40.0]], [[60.0, 48.0], [48.0, 60.0]]
    field = Field(name="L", obstacles=Obstacles.boxes(low, high))
    around = [[40.0, 40.0], [60.0, 40.0], [60.0, 48.0], [48.0, 60.0], [40.0, 60.0]]
    one = Field(name="hull", obstacles=Obstacles.polygons([around]))
    for point in ([0.0, 0.0], [20.0, 50.0], [50.0, 10.0]):
        found, expected = best_classes(field, point, 8), best_classes(one, point, 8)
        assert len(found) == len(expected) == 2
        np.testing.assert_allclose(
            [path.length for path in found], [path.length for path in expected], rtol=1e-12
        )
