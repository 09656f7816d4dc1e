"""Footprints cut into convex pieces: the same area, and every cut inside a piece."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.world.obstacles import Obstacles

shapely = pytest.importorskip("shapely")
from ferguson_gym.importers.convex_pieces import convex_pieces  # noqa: E402

ELL = [(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)]
COMB = [(0, 0), (50, 0), (50, 20), (44, 20), (44, 6), (28, 6), (28, 20), (22, 20), (22, 6), (6, 6),
        (6, 20), (0, 20)]  # fmt: skip
HOUSE = [(0, 0), (30, 0), (30, 30), (0, 30)]
YARD = [(10, 10), (20, 10), (20, 20), (10, 20)]


def star(numbers):
    """A polygon around the origin, whose corners have these distances from it."""
    angles = 2.0 * np.pi * np.arange(len(numbers)) / len(numbers)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return shapely.Polygon(np.array(numbers)[:, None] * directions)


def check(polygon):
    pieces = convex_pieces(polygon)
    made = [shapely.Polygon(piece) for piece in pieces]
    assert all(piece.is_valid for piece in made)
    for piece in made:  # convex, but for rounding
        assert piece.convex_hull.area <= piece.area * (1.0 + 1e-9)
    union = shapely.union_all(made)
    assert union.symmetric_difference(polygon).area <= 1e-9 * polygon.area
    # inside the footprint there is no point that all pieces leave free
    obstacles = Obstacles.polygons(pieces)
    low, high = np.array(polygon.bounds).reshape(2, 2)
    points = np.random.default_rng(0).uniform(low, high, (500, 2))
    cuts = [(np.array(piece) + np.roll(piece, -1, axis=0)) / 2.0 for piece in pieces]
    points = np.concatenate([points, *cuts])
    inner = shapely.contains_xy(polygon.buffer(-1e-6), points)
    assert (obstacles.signed_distance(points[inner]).min(axis=-1) < 0.0).all()
    return pieces


@pytest.mark.parametrize(
    ("rings", "most"), [([HOUSE], 1), ([ELL], 2), ([COMB], 4), ([HOUSE, YARD], 4)]
)
def test_footprints_become_few_pieces(rings, most):
    assert 1 <= len(check(shapely.Polygon(rings[0], rings[1:]))) <= most


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(1.0, 20.0), min_size=3, max_size=24))
def test_any_star_is_its_pieces(numbers):
    check(star(numbers))


@settings(deadline=None, max_examples=30)
@given(
    st.lists(st.floats(12.0, 20.0), min_size=5, max_size=14),
    st.lists(st.floats(1.0, 9.0), min_size=3, max_size=9),
)
def test_any_star_with_a_hole_is_its_pieces(outer, inner):
    check(shapely.Polygon(star(outer).exterior, [star(inner).exterior]))
