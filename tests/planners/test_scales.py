"""Flights in a field that is moved, scaled, mirrored or turned are moved, scaled, ... flights."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world import Field, Obstacles, get_field, inspect, is_feasible
from planners.contract import check_planner
from planners.interface import Plan, initial_state
from planners.registry import make
from tests.support.scaled_fields import MOTIONS, Motion

FIELDS = tuple(map(get_field, ("paper:1", "dense/train:1", "traps/train:2")))
EXACTLY = {"guided": 1e-6, "shortest": 1e-6, "pursuit": 1e-6, "voronoi": 1e-5, "astar": 1e-5}
"""Relative accuracy of lengths: fits to routes other than the shortest start farther from an
optimum, and the solver stops at 1e-6 of its objective."""
SAMPLING = ("multi-start", "rrt")


@cache
def planned(name: str, field: Field) -> Plan:
    return make(name).plan(field, initial_state(field), 0)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=list(MOTIONS))
@pytest.mark.parametrize("name", EXACTLY)
def test_deterministic_planners_fly_the_image_of_their_flight(name: str, motion: Motion) -> None:
    for field in FIELDS:
        moved = motion.field(field)
        plan, image = planned(name, field), planned(name, moved)
        assert image.status is plan.status
        assert len(image.control) == len(plan.control)
        assert is_feasible(image.control, moved).all()
        if plan.path is not None and image.path is not None:
            expected = pytest.approx(motion.scale * plan.path.length, rel=EXACTLY[name])
            assert image.path.length == expected
            # knots may slide along straight parts of a path
            off = motion.points(plan.control[:, 1]) - image.control[:, 1]
            assert np.abs(off).max() < 0.5 * motion.scale
        if plan.route is not None and image.route is not None:
            expected = pytest.approx(motion.scale * plan.route.length, rel=1e-9)
            assert image.route.length == expected


@pytest.mark.parametrize("motion", [Motion(scale=0.02), Motion(50.0, (1e5, 0.0))], ids=str)
@pytest.mark.parametrize("name", ["single-start", *SAMPLING])
def test_other_planners_succeed_in_the_image_of_a_field(name: str, motion: Motion) -> None:
    if name in SAMPLING[1:]:
        pytest.importorskip("ompl")
    field = get_field("sparse/train:1")
    moved = motion.field(field)
    plan, image = planned(name, field), planned(name, moved)
    assert image.success == plan.success
    assert is_feasible(image.control, moved).all()


@pytest.mark.parametrize("name", ["guided", "multi-start+backtrack", "guided+turn=80", "shortest"])
def test_planners_keep_their_contract_at_another_scale(name: str) -> None:
    check_planner(make(name), MOTIONS["far away"].field(Motion(10.0).field(get_field("paper:2"))))


def test_a_turn_radius_is_one_of_the_field() -> None:
    field = get_field("sparse/train:0")
    plan = planned("guided+turn=4", field)
    image = planned("guided+turn=400", Motion(100.0).field(field))
    assert image.path is not None
    assert plan.path is not None
    assert image.path.length == pytest.approx(100.0 * plan.path.length, rel=1e-6)


def test_limits_that_are_given_hold_in_every_planner() -> None:
    field = get_field("standard/train:0").with_limits(longest=9.0, shortest=4.0, gate=0.2)
    for name in ("guided", "shortest", "pursuit", "multi-start", "guided+sensing=20"):
        plan = planned(name, field)
        assert plan.success, name
        length = inspect(plan.control, field).length
        assert length.max() <= 9.0 + field.limits.tolerance
        assert length.min() >= 4.0 - field.limits.tolerance


def test_a_sensing_range_below_the_longest_segment_of_the_field_is_refused() -> None:
    field = Motion(10.0).field(get_field("sparse/train:0"))
    with pytest.raises(ValueError, match=r"at least the longest segment, 150 m .*, got 20 m"):
        planned("guided+sensing=20", field)


@pytest.mark.parametrize("name", ["guided", "shortest"])
def test_decisions_and_routes_are_those_of_the_field(name: str) -> None:
    field = Motion(10.0, (500.0, 0.0)).field(get_field("paper:2"))
    plan = planned(name, field)
    assert plan.success
    for decision in plan.decisions:
        assert decision.chain is not None
        assert is_feasible(decision.chain, field).all()
    if plan.route is not None:
        np.testing.assert_allclose(plan.route.points[[0, -1]], [field.start, field.goal], atol=1e-9)
        assert plan.route.length == pytest.approx(exact_length(field), rel=1e-9)
    else:
        assert plan.decisions[0].report.objective == pytest.approx(exact_length(field), rel=2e-3)


def test_initial_guesses_are_those_of_the_field() -> None:
    field = Motion(10.0, (500.0, 0.0)).field(get_field("paper:2"))
    first = make("single-start").decide(field, initial_state(field), 0)
    guess = first.candidates[0][1]
    np.testing.assert_allclose(guess[0, 0], field.start, atol=1e-9)


def test_a_goal_that_a_disc_touches_is_reached_at_any_scale() -> None:
    field = Field(name="touched", obstacles=Obstacles.discs([[100.0, 95.0]], [5.0]))
    for motion in MOTIONS.values():
        assert planned("guided", motion.field(field)).success


@pytest.mark.parametrize("name", ["guided", "shortest", "pursuit"])
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_strides_are_longer_where_few_segments_are_left(name: str, seed: int) -> None:
    field = get_field(f"standard/train:{seed}")
    exact = exact_length(field)
    assert exact is not None
    few = math.ceil(exact / 14.5)
    plan = planned(name, field.with_limits(segments=few))
    assert plan.success
    assert len(plan.control) <= few
    assert len(planned(name, field).control) > few


@pytest.mark.parametrize("name", ["guided", "shortest", "pursuit"])
def test_two_kilometres_are_flown(name: str) -> None:
    discs = Obstacles.discs([[700.0, 710.0], [1000.0, 980.0]], [30.0, 40.0])
    far = Field(name="far", obstacles=discs, goal=[1414.0, 1414.0], bounds=(-10.0, 1424.0))
    plan = planned(name, far)
    assert plan.path is not None
    assert plan.path.length < 1.002 * (exact_length(far) or 0.0)
