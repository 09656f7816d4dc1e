"""Convex cells of the free space, and which of them a shortest route may pass through."""

from dataclasses import replace

import networkx
import numpy as np
import pytest

from ferguson_gym.shortest_paths import shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.whole_path.gcs.cells import Cells, free_cells, without_detours
from planners.whole_path.gcs.funnel import taut_length
from planners.whole_path.gcs.polygons import circumscribed

shapely = pytest.importorskip("shapely")
SQUARE = np.array([[0.0, 0.0], [10.0, 10.0]])


def cells_of(field: Field, corners: int = 12) -> Cells:
    ends = np.stack([field.start, field.goal])
    polygons = circumscribed(field.obstacles, corners, ends)
    cells = free_cells(polygons, field.bounds, field.start, field.goal, 2e-5)
    assert cells is not None
    return cells


def crossed(cells: Cells) -> networkx.Graph:
    return networkx.Graph(cells.sides.keys())


@pytest.mark.parametrize("name", ["standard/train:0", "dense/train:1", "town/train:0"])
def test_cells_are_convex_apart_and_cover_the_free_space(name: str) -> None:
    field = get_field(name)
    cells = cells_of(field)
    shapes = [shapely.Polygon(corners) for corners in cells.corners]
    for shape in shapes:
        assert shape.convex_hull.area == pytest.approx(shape.area, rel=1e-9)
    whole = shapely.union_all(shapes)
    assert whole.area == pytest.approx(sum(shape.area for shape in shapes), rel=1e-9)
    ends = np.stack([field.start, field.goal])
    solid = shapely.union_all(
        [shapely.Polygon(polygon) for polygon in circumscribed(field.obstacles, 12, ends)]
    )
    assert solid.intersection(whole).area < 1e-9
    parts = shapely.get_parts(shapely.box(*field.bounds.ravel()).difference(solid))
    (mine,) = [part for part in parts if part.distance(shapely.Point(field.start)) < 1e-9]
    assert whole.area == pytest.approx(mine.area, rel=1e-9)
    for (one, other), side in cells.sides.items():
        np.testing.assert_array_equal(cells.sides[other, one], side[::-1])
        line = shapely.LineString(side)
        assert max(shapes[one].distance(line), shapes[other].distance(line)) < 1e-12
    assert all(shapes[k].distance(shapely.Point(field.start)) < 1e-6 for k in cells.first)
    assert all(shapes[k].distance(shapely.Point(field.goal)) < 1e-6 for k in cells.last)


def test_a_start_and_a_goal_that_are_apart_have_no_cells() -> None:
    wall = np.array([[4.0, -1.0], [5.0, -1.0], [5.0, 11.0], [4.0, 11.0]])
    start, goal = np.array([1.0, 5.0]), np.array([9.0, 5.0])
    assert free_cells([wall], SQUARE, start, goal, 1e-5) is None
    assert free_cells([wall], SQUARE, start, np.array([3.0, 5.0]), 1e-5) is not None


def test_an_end_just_outside_is_moved_in() -> None:
    start, goal = np.array([-1e-6, 5.0]), np.array([9.0, 5.0])
    cells = free_cells([], SQUARE, start, goal, 1e-5)
    assert cells is not None
    np.testing.assert_allclose(cells.start, [0.0, 5.0], atol=1e-12)
    assert free_cells([], SQUARE, start, goal, 1e-7) is None


@pytest.mark.parametrize("suite", ["standard", "traps", "town"])
def test_the_shortest_way_stays_in_the_cells_that_are_kept(suite: str) -> None:
    for field in get_fields(f"{suite}/train:0-4"):
        cells = cells_of(field)
        few = without_detours(cells)
        assert len(few.corners) < len(cells.corners)
        assert few.first
        assert few.last
        assert networkx.is_connected(crossed(few))
        ends = np.stack([field.start, field.goal])
        around = Obstacles.polygons(circumscribed(field.obstacles, 12, ends))
        path = shortest_path(replace(field, obstacles=around))
        assert path is not None
        whole = shapely.union_all([shapely.Polygon(one) for one in few.corners]).buffer(1e-6)
        assert whole.covers(shapely.LineString(path.points(1.0)))


def test_dead_ends_are_left_out() -> None:
    # a pocket to the left of the way from the bottom to the top
    walls = [
        np.array([[0.0, 4.0], [3.0, 4.0], [3.0, 5.0], [0.0, 5.0]]),
        np.array([[0.0, 8.0], [3.0, 8.0], [3.0, 9.0], [0.0, 9.0]]),
    ]
    start, goal = np.array([0.5, 1.0]), np.array([0.5, 9.5])
    cells = free_cells(walls, SQUARE, start, goal, 1e-5)
    assert cells is not None
    few = without_detours(cells)
    graph = crossed(few)
    assert all(graph.degree[k] > 1 for k in graph if k not in (*few.first, *few.last))
    assert len(few.corners) < len(cells.corners)


def test_the_taut_line_turns_at_the_ends_of_sides() -> None:
    start, goal = np.array([0.0, 0.0]), np.array([10.0, 0.0])
    right_to_left = np.array([[5.0, -1.0], [5.0, 1.0]])
    assert taut_length(start, [right_to_left], goal) == pytest.approx(10.0)
    above = np.array([[5.0, 2.0], [5.0, 4.0]])
    assert taut_length(start, [above], goal) == pytest.approx(2.0 * np.hypot(5.0, 2.0))
    below = np.array([[7.0, -4.0], [7.0, -1.0]])
    turned = np.hypot(5.0, 2.0) + np.hypot(2.0, 3.0) + np.hypot(3.0, 1.0)
    assert taut_length(start, [above, below], goal) == pytest.approx(turned)
    assert taut_length(start, [], goal) == pytest.approx(10.0)
