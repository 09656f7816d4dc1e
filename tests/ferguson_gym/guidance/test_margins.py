"""Margins leave passages open, keep start and goal free, and points within them are moved out."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import shapely

from ferguson_gym.guidance.margins import OUTSIDE, outside, solids, surroundings
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.scaled_fields import Motion
from tests.support.visibility import random_mixture


def beside_the_diagonal(*places: tuple[float, float, float]) -> Field:
    """Discs so far along the straight line to the goal, so far to its left, so large [m]."""
    along, across = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([-1.0, 1.0]) / np.sqrt(2.0)
    centers = [ahead * along + left * across for ahead, left, _ in places]
    return Field(name="made", obstacles=Obstacles.discs(centers, [radius for *_, radius in places]))


def margins_by_every_pair(field: Field, margin: float, narrowest: float) -> np.ndarray:
    """The margins from a table of the gaps between all pairs of discs."""
    discs = field.obstacles
    apart = np.linalg.norm(discs.centers[:, None] - discs.centers, axis=-1)
    gaps = apart - discs.radii[:, None] - discs.radii
    np.fill_diagonal(gaps, np.inf)
    gaps[gaps < narrowest] = np.inf
    room = discs.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
    most = np.minimum(0.45 * gaps.min(axis=1, initial=np.inf), room - 1e-7)
    return np.clip(most, 0.0, margin)


@pytest.mark.parametrize("name", ["paper:2", "dense/train:1", "forest/train:2", "traps/train:0"])
@pytest.mark.parametrize(("margin", "narrowest"), [(0.8, 0.8), (0.1, 2.0), (5.0, 0.3)])
def test_margins_are_those_from_every_pair(name: str, margin: float, narrowest: float) -> None:
    field = get_field(name)
    expected = margins_by_every_pair(field, margin, narrowest)
    np.testing.assert_array_equal(surroundings(field, margin, narrowest).margins, expected)


@pytest.mark.parametrize("seed", range(6))
def test_margins_of_every_shape_are_those_from_every_pair(seed: int) -> None:
    field = random_mixture(seed)
    every = field.obstacles
    cores = [shapely.multipoints(every.core(k)).convex_hull for k in range(len(every))]
    gaps = shapely.distance(np.array(cores)[:, None], np.array(cores))
    gaps -= every.radii[:, None] + every.radii
    gaps[gaps < 0.8] = np.inf
    np.fill_diagonal(gaps, np.inf)
    room = every.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
    expected = np.clip(np.minimum(0.45 * gaps.min(axis=1), room - 1e-7), 0.0, 3.0)
    margins, togo = surroundings(field, 3.0, 0.8)
    np.testing.assert_allclose(margins, expected, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(togo.field.obstacles.radii, every.radii + margins)


def test_among_thousands_of_discs_margins_take_no_table_of_pairs() -> None:
    stream = np.random.default_rng(0)
    centers = stream.uniform(1.0, 1999.0, (20_000, 2))
    many = Obstacles.discs(centers, stream.uniform(1.0, 3.0, 20_000))
    free = (many.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])) > 1.0).all(axis=0)
    field = Field(name="many", obstacles=many.only(free), bounds=(-10.0, 2000.0))
    few = Field(name="few", obstacles=many.only(np.flatnonzero(free)[:300]), bounds=(-10.0, 2000.0))
    surroundings(few, 0.8, 0.8)  # what is compiled takes memory, too
    tracemalloc.start()
    margins = surroundings(field, 0.8, 0.8).margins
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 100e6
    assert 0.0 < margins.min() < 0.8 == margins.max()


def test_discs_beside_a_gap_take_a_margin_that_leaves_a_tenth_of_it() -> None:
    field = beside_the_diagonal((60.0, 5.0, 4.5), (60.0, -5.0, 4.5), (90.0, 0.0, 4.0))
    margins = surroundings(field, 0.8, 0.8).margins
    np.testing.assert_allclose(margins, [0.45, 0.45, 0.8])


def test_start_and_goal_stay_outside_of_grown_discs() -> None:
    field = beside_the_diagonal((3.0, 2.5, 2.2), (np.sqrt(2) * 100.0, 4.0, 3.9))
    margins, togo = surroundings(field, 0.8, 0.8)
    assert margins[1] == pytest.approx(0.1, abs=1e-5)
    for point in (field.start, field.goal):
        assert togo.field.obstacles.signed_distance(point).min() >= 0.0


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_margins_scale_with_the_field(scale: float) -> None:
    field = get_field("dense/train:1")
    unit, scaled = surroundings(field, 0.8, 0.8), Motion(scale=scale).field(field)
    margins = surroundings(scaled, 0.8 * scale, 0.8 * scale).margins
    np.testing.assert_allclose(margins, scale * unit.margins, rtol=1e-9, atol=1e-12 * scale)


def test_without_a_margin_and_without_discs_nothing_grows() -> None:
    field = get_field("dense/train:1")
    margins, togo = surroundings(field, 0.0, 0.0)
    assert not margins.any()
    np.testing.assert_array_equal(togo.field.obstacles.radii, field.obstacles.radii)
    assert (
        len(surroundings(Field(name="open", obstacles=Obstacles.discs([], [])), 0.8, 0.8).margins)
        == 0
    )


def moved(x: float, y: float, *discs: tuple[float, float, float]) -> tuple[float, float, bool]:
    each = np.array(discs).reshape(-1, 3)
    return outside(x, y, solids(Obstacles.discs(each[:, :2], each[:, 2])), OUTSIDE)


def test_points_in_no_disc_stay_and_others_leave_by_the_nearest_way() -> None:
    assert moved(3.0, 4.0) == (3.0, 4.0, True)
    assert moved(3.0, 4.0, (0.0, 0.0, 5.0)) == (3.0, 4.0, True)
    x, y, found = moved(3.0, 4.0, (0.0, 0.0, 10.0), (50.0, 0.0, 9.0))
    assert found
    assert (x, y) == pytest.approx((6.0, 8.0), abs=2e-7)
    assert np.hypot(x, y) > 10.0


def test_a_point_leaves_discs_that_overlap_and_the_centre_of_one() -> None:
    x, y, found = moved(1.0, 0.1, (0.0, 0.0, 2.0), (2.5, 0.0, 2.0))
    assert found
    assert min(np.hypot(x, y), np.hypot(x - 2.5, y)) >= 2.0
    assert moved(7.0, -3.0, (7.0, -3.0, 0.5)) == pytest.approx((7.5, -3.0, True), abs=2e-7)


def test_a_point_on_the_line_of_two_centres_that_goes_to_and_fro_finds_no_way_out() -> None:
    assert not moved(1.25, 0.0, (0.0, 0.0, 2.0), (2.5, 0.0, 2.0))[2]


@pytest.mark.parametrize("seed", range(4))
def test_points_leave_obstacles_of_every_shape_by_the_nearest_way(seed: int) -> None:
    every = random_mixture(seed).obstacles
    for k in range(len(every)):
        one = every.only_these(np.array([k]))
        (center,), (radius,) = one.balls
        points = np.random.default_rng(k).uniform(center - radius, center + radius, (30, 2))
        for x, y in points.tolist():
            depth = one.signed_distance(np.array([x, y]))[0]
            there_x, there_y, found = outside(x, y, solids(one), OUTSIDE)
            assert found
            moved = np.hypot(there_x - x, there_y - y)
            if depth >= 0.0:
                assert moved == 0.0
            else:
                assert one.signed_distance(np.array([there_x, there_y]))[0] > 0.5 * OUTSIDE
                assert moved == pytest.approx(OUTSIDE - depth, abs=1e-9)
