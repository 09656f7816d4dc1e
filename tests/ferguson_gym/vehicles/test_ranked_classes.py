"""Homotopy classes ranked by predicted time."""

import dataclasses
import math

import numpy as np
import pytest

from ferguson_gym.shortest_paths.homotopy_classes import best_classes
from ferguson_gym.vehicles.bound import fastest_bound
from ferguson_gym.vehicles.ranked_classes import OPTIMISM, ranked_classes
from ferguson_gym.vehicles.vehicle_names import get_vehicle
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles

WING, ROTOR = get_vehicle("fixed-wing"), get_vehicle("multirotor")


def with_discs(*discs: tuple[float, float, float]) -> Field:
    return Field(
        name="few",
        obstacles=Obstacles.discs([disc[:2] for disc in discs], [disc[2] for disc in discs]),
    )


def test_a_straight_line_is_predicted_at_its_bound() -> None:
    field = with_discs((90.0, 10.0, 5.0))
    for vehicle in (WING, ROTOR):
        first = ranked_classes(field, vehicle, 3)[0]
        assert first.bound == pytest.approx(fastest_bound(field, vehicle))
        assert first.seconds == pytest.approx(first.bound, rel=2e-3)


def test_the_shortest_class_is_often_not_the_fastest() -> None:
    """Of ten fields; all that could be the fastest are there, the fastest first."""
    others = 0
    for field in get_fields("standard/train:0-9"):
        ranked = ranked_classes(field, ROTOR, 24)
        times = [one.seconds for one in ranked]
        assert times == sorted(times)
        assert all(one.bound <= (1.0 + OPTIMISM) * times[0] for one in ranked)
        assert all(one.bound <= one.seconds for one in ranked)
        shortest = best_classes(field, field.start, 1)[0]
        others += ranked[0].path.length > shortest.length
    assert others >= 3


def test_a_path_that_turns_wide_is_predicted_faster() -> None:
    """One disc on the way: the larger it is, the wider the turns, and the higher the speed."""
    ratios = []
    for radius in (2.0, 10.0, 30.0):
        field = with_discs((50.0, 50.0, radius))
        first = ranked_classes(field, WING, 1)[0]
        ratios.append(first.path.length / first.seconds)
    assert ratios == sorted(ratios)


def test_predictions_scale_with_the_field() -> None:
    """Lengths by 4, times by 2: accelerations stay."""
    field = get_field("paper:1")
    obstacles = Obstacles.discs(4.0 * field.obstacles.centers, 4.0 * field.obstacles.radii)
    large = Field(
        name="large",
        obstacles=obstacles,
        start=4.0 * field.start,
        goal=4.0 * field.goal,
        bounds=4.0 * field.bounds,
        start_derivative=4.0 * field.departure,
        limits=dataclasses.replace(field.limits, longest=60.0, shortest=12.0, gate=4.0),
    )
    faster = dataclasses.replace(WING, max_speed=30.0, min_speed=12.0)
    ours, theirs = ranked_classes(field, WING, 5), ranked_classes(large, faster, 5)
    assert len(ours) == len(theirs)
    np.testing.assert_allclose(
        [2.0 * one.seconds for one in ours], [one.seconds for one in theirs], rtol=1e-6
    )


def test_no_path_and_bad_arguments() -> None:
    ring = [(10.0 * math.cos(a), 10.0 * math.sin(a), 4.0) for a in np.linspace(0.0, 6.0, 14)]
    assert ranked_classes(with_discs(*ring), WING, 3) == []
    with pytest.raises(ValueError, match="at least 1 class"):
        ranked_classes(with_discs((90.0, 10.0, 5.0)), WING, 0)
    with pytest.raises(ValueError, match="outside the speeds"):
        ranked_classes(with_discs((90.0, 10.0, 5.0)), WING, 3, start_speed=1.0)
