"""The way ahead is the shortest path among grown discs, found without the compiled tree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.guidance.margins import outside, solids
from ferguson_gym.guidance.way import Way, with_margin
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import distance_to_goal
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support import taut_paths
from tests.support.scaled_fields import Motion
from tests.support.visibility import random_mixture

SHOWN = np.array([0.5, 3.0, 10.0, 30.0, 80.0, 400.0])
"""Distances along the way, of which the last lies beyond every goal [m]."""
NAMES = ["paper:2", "standard/train:1", "dense/train:2", "forest/train:1", "traps/train:0"]
FIELDS = [*map(get_field, NAMES), *(random_mixture(seed) for seed in range(4))]
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
ENCLOSED = Field(
    name="enclosed",
    obstacles=Obstacles.discs(
        [[100.0 + 9.0 * np.cos(a), 100.0 + 9.0 * np.sin(a)] for a in range(7)], [6.0] * 7
    ),
)
"""No path leads to the goal."""


def random_points(number: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(-9.0, 109.0, (number, 2))


def far_from(field: Field, points: Array, least: float) -> Array:
    """Which points are at least this far from all discs, (n,)."""
    if not len(field.obstacles):
        return np.ones(len(points), np.bool_)
    return np.asarray(field.obstacles.signed_distance(points).min(axis=1) >= least)


@pytest.mark.parametrize("margin", [0.0, 0.8, 3.0])
@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_points_ahead_and_distances_are_those_of_the_path_among_grown_obstacles(
    field: Field, margin: float
) -> None:
    togo = with_margin(field, margin)
    points = random_points(60)
    points = points[far_from(togo.field, points, 1e-6)]
    points = np.vstack([points, field.start, field.goal])
    places, distances = Way(field, margin).ahead(points, SHOWN[None])
    assert places.shape == (len(points), len(SHOWN), 2)
    expected, _ = togo(points)
    there = np.isfinite(expected)
    assert there.mean() > 0.6
    np.testing.assert_allclose(distances[there], expected[there], rtol=1e-12, atol=1e-9)
    for point, spots in zip(points[there], places[there], strict=True):
        path = togo.path(point)
        assert path is not None
        np.testing.assert_allclose(spots, path.at(SHOWN), rtol=0, atol=1e-9)
    assert (places[there, -1] == field.goal).all()
    assert distances[-1] == 0.0
    assert (places[-1] == field.goal).all()


@pytest.mark.parametrize("name", NAMES)
def test_what_is_shown_does_not_depend_on_the_number_of_points(name: str) -> None:
    way, points = Way(get_field(name), 0.8), random_points(30, seed=1)
    places, togo = way.ahead(points, SHOWN[None])
    for k, point in enumerate(points):
        alone = way.ahead(point[None], SHOWN[None])
        np.testing.assert_array_equal(alone[0][0], places[k])
        np.testing.assert_array_equal(alone[1][0], togo[k])


def test_from_within_a_margin_the_way_leads_out_of_it_first() -> None:
    field = Field(name="one", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0]))
    point = 50.0 - 10.3 / np.sqrt(2.0) * np.ones(2)
    rim = 50.0 - 11.0 / np.sqrt(2.0) * np.ones(2)
    places, togo = Way(field, 1.0).ahead(point[None], [[0.35, 0.7, 5.0]])
    np.testing.assert_allclose(places[0, 0], (point + rim) / 2.0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(places[0, 1], rim, rtol=0, atol=1e-6)
    assert np.hypot(*(places[0, 2] - 50.0)) == pytest.approx(11.0, abs=1e-6)
    around = DistanceToGoal(Field(name="grown", obstacles=Obstacles.discs([[50.0, 50.0]], [11.0])))
    assert togo[0] == pytest.approx(0.7 + around([rim])[0][0], abs=1e-6)


def test_where_no_way_keeps_margins_it_is_the_shortest_path() -> None:
    # the vehicle is in a corner between two discs and the bounds, which margins close
    discs = Obstacles.discs([[-4.0, 60.0], [-4.0, 47.5]], [6.0, 6.0])
    field = Field(name="corner", obstacles=discs)
    point = np.array([-9.9, 53.7])
    assert discs.signed_distance(point).min() > 0.0
    assert np.isinf(with_margin(field, 0.8)([point])[0][0])
    places, togo = Way(field, 0.8).ahead(point[None], SHOWN[None])
    exact = DistanceToGoal(field)
    path = exact.path(point)
    assert path is not None
    assert togo[0] == pytest.approx(path.length, abs=1e-9)
    np.testing.assert_allclose(places[0], path.at(SHOWN), rtol=0, atol=1e-9)


def test_without_any_path_the_distance_is_infinite_and_points_ahead_stay() -> None:
    points = np.array([[0.0, 0.0], [100.0, 100.5], [31.0, 7.0]])
    places, togo = Way(ENCLOSED, 0.8).ahead(points, SHOWN[None])
    assert np.isinf(togo).tolist() == [True, False, True]
    for k in (0, 2):
        assert (places[k] == points[k]).all()
    np.testing.assert_allclose(places[1], [[100.0, 100.0]] * len(SHOWN), rtol=0, atol=1e-9)


def test_in_an_open_field_the_way_is_straight() -> None:
    places, togo = Way(OPEN, 5.0).ahead(np.array([[0.0, 0.0], [100.0, 40.0]]), SHOWN[None])
    np.testing.assert_allclose(togo, [np.sqrt(2.0) * 100.0, 60.0])
    np.testing.assert_allclose(places[1, :, 0], 100.0)
    np.testing.assert_allclose(places[1, :, 1], np.minimum(40.0 + SHOWN, 100.0))
    assert Way(OPEN, 5.0).ahead(np.zeros((2, 2)), np.empty((1, 0)))[0].shape == (2, 0, 2)
    assert Way(OPEN, 5.0).ahead(np.zeros((0, 2)), SHOWN[None])[1].shape == (0,)


@pytest.mark.parametrize("margin", [0.0, 0.8])
@pytest.mark.parametrize("name", ["standard/train:1", "traps/train:0"])
def test_among_many_discs_the_way_is_the_same(
    name: str, margin: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = get_field(name)
    points = random_points(40, seed=2)
    points = points[far_from(field, points, 0.0)]
    assert (~far_from(with_margin(field, 2.0).field, points, 0.0)).sum() > 1
    places, togo = Way(field, margin).ahead(points, SHOWN[None])
    monkeypatch.setattr(distance_to_goal, "FEW", 0)
    many = Way(get_field(name), margin)  # another field, since results are cached
    others, lengths = many.ahead(points, SHOWN[None])
    np.testing.assert_allclose(lengths, togo, rtol=0, atol=1e-7)
    np.testing.assert_allclose(others, places, rtol=0, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_the_way_scales_with_the_field(scale: float) -> None:
    field, motion = get_field("dense/train:2"), Motion(scale=scale, shift=(3.0, -7.0))
    points = random_points(30, seed=3)
    places, togo = Way(field, 0.8).ahead(points, SHOWN[None])
    images, lengths = Way(motion.field(field), 0.8).ahead(motion.points(points), SHOWN[None])
    np.testing.assert_allclose(lengths, scale * togo, rtol=1e-6)
    np.testing.assert_allclose(images, motion.points(places), rtol=0, atol=1e-5 * scale)


def test_other_fields_and_distances_are_refused() -> None:
    solid = Field(
        name="solid", obstacles=Obstacles.discs([[5.0] * 3], [1.0]), start=[0.0] * 3, goal=[9.0] * 3
    )
    with pytest.raises(ValueError, match=r"plane|planar"):
        Way(solid, 0.8)
    with pytest.raises(ValueError, match="distances must be finite, got nan"):
        Way(OPEN, 0.8).ahead(np.zeros((1, 2)), [[1.0, np.nan]])
    with pytest.raises(ValueError, match="need 1 or 3 rows of distances, got 2"):
        Way(OPEN, 0.8).ahead(np.zeros((3, 2)), np.ones((2, 4)))


@given(
    field=taut_paths.fields(most=9),
    margin=st.sampled_from([0.0, 0.8, 2.5]),
    points=st.lists(st.tuples(taut_paths.numbers, taut_paths.numbers), min_size=1, max_size=4),
)
@settings(max_examples=150, deadline=None)
def test_distances_in_any_field_are_exact_or_those_of_the_nearest_free_point(
    field: Field, margin: float, points: list[Any]
) -> None:
    kept, exact = with_margin(field, margin), DistanceToGoal(field)
    places, togo = Way(field, margin).ahead(np.array(points), SHOWN[None])
    grown = solids(kept.field.obstacles)
    for point, spots, length in zip(np.array(points), places, togo, strict=True):
        x, y, found = outside(*point.tolist(), grown, 1e-7)
        expected = np.hypot(x - point[0], y - point[1]) + kept([[x, y]])[0][0]
        if not found or np.isinf(expected):
            truly = exact([point])[0][0]
            near = len(field.obstacles) and field.obstacles.signed_distance(point).min() < 1e-4
            assert near or length == pytest.approx(truly, abs=1e-6)
        else:
            assert length == pytest.approx(expected, abs=1e-6)
        assert np.isfinite(spots).all()
        # no two points ahead are further apart than along the way
        chords = np.linalg.norm(np.diff(np.vstack([point, spots]), axis=0), axis=1)
        assert (chords <= np.diff(np.append(0.0, SHOWN)) + 1e-6).all()
