"""Polygons around obstacles: they contain them, and keep what has to stay free."""

import numpy as np
import pytest

from ferguson_gym.world.obstacles import Obstacles
from planners.whole_path.gcs.polygons import circumscribed, excess

shapely = pytest.importorskip("shapely")
NOWHERE = np.empty((0, 2))
DISC = Obstacles.discs([[3.0, -2.0]], [5.0])


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("corners", [3, 12, 48])
def test_a_disc_gets_a_regular_polygon_that_touches_it(corners: int) -> None:
    (polygon,) = circumscribed(DISC, corners, NOWHERE)
    assert len(polygon) == corners
    middles = 0.5 * (polygon + np.roll(polygon, -1, axis=0))
    np.testing.assert_allclose(DISC.signed_distance(middles), 0.0, atol=1e-12)
    beyond = excess(DISC.radii, corners)
    np.testing.assert_allclose(DISC.signed_distance(polygon), beyond[0], atol=1e-12)
    assert area(polygon) == pytest.approx(corners * 25.0 * np.tan(np.pi / corners))


def test_a_polygon_stays_as_it_is() -> None:
    block = np.array([[0.0, 0.0], [4.0, 1.0], [3.0, 5.0], [-1.0, 4.0]])
    (polygon,) = circumscribed(Obstacles.polygons([block]), 12, NOWHERE)
    assert shapely.equals_exact(
        shapely.Polygon(polygon).normalize(), shapely.Polygon(block).normalize(), 1e-12
    )


@pytest.mark.parametrize("seed", range(5))
def test_rounded_shapes_are_contained_and_flat_sides_are_kept(seed: int) -> None:
    stream = np.random.default_rng(seed)
    block = np.array(
        shapely.MultiPoint(stream.uniform(0.0, 9.0, (6, 2))).convex_hull.exterior.coords
    )
    obstacles = Obstacles.joined(
        [
            Obstacles.polygons([block[::-1][:-1]], 1.5),
            Obstacles.capsules([[[20.0, 0.0], stream.uniform(21.0, 25.0, 2)]], 0.7),
        ]
    )
    for k, polygon in enumerate(circumscribed(obstacles, 12, NOWHERE)):
        around = shapely.Polygon(polygon)
        assert around.is_valid
        assert area(polygon) > 0.0
        core = shapely.MultiPoint(obstacles.core(k)).convex_hull
        rounded = core.buffer(obstacles.radii[k], quad_segs=64)
        assert around.buffer(1e-9).contains(rounded)
        assert np.all(np.abs(around.area - rounded.area) < 0.05 * rounded.area)
        middles = 0.5 * (polygon + np.roll(polygon, -1, axis=0))
        every = obstacles.only_these(np.array([k])).signed_distance(middles)
        assert every.min() >= -1e-9
        assert every.max() <= excess(obstacles.radii, 12)[k]


def test_start_and_goal_stay_free_however_near_they_are() -> None:
    turn = np.deg2rad(np.linspace(0.0, 360.0, 24, endpoint=False))
    for out in (0.0, 1e-9, 1e-3, 0.1, 1.0):
        for angle in turn:
            place = np.array([3.0, -2.0]) + (5.0 + out) * np.array([np.cos(angle), np.sin(angle)])
            (polygon,) = circumscribed(DISC, 12, place[None])
            assert shapely.Polygon(polygon).buffer(-1e-9).disjoint(shapely.Point(place))
            assert len(polygon) <= 13


@pytest.mark.parametrize("width", [1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("angle", [0.0, 0.1, 0.26, 1.0])
def test_a_narrow_passage_stays_as_wide_as_it_is(width: float, angle: float) -> None:
    along = np.array([np.cos(angle), np.sin(angle)])
    two = Obstacles.discs([[0.0, 0.0], (9.0 + width) * along], [4.0, 5.0])
    one, other = (shapely.Polygon(polygon) for polygon in circumscribed(two, 12, NOWHERE))
    assert one.distance(other) == pytest.approx(width, abs=1e-9)
    far = Obstacles.discs([[0.0, 0.0], 20.0 * along], [4.0, 5.0])
    assert [len(polygon) for polygon in circumscribed(far, 12, NOWHERE)] == [12, 12]


def test_without_obstacles_there_are_no_polygons() -> None:
    assert circumscribed(Obstacles.discs([], []), 12, NOWHERE) == []
