"""Planners as policies: a flight in the environment is the plan, bit for bit."""

import numpy as np
import pytest

from agents.flights.flight import Flight, fly
from agents.policies.planner_policies import ReplanningPolicy, TrackingPolicy, planner_policy
from agents.policies.registry import make_policy
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Plan, Status, initial_state
from planners.receding_horizon.paper import RecedingHorizon
from planners.registry import PLANNERS, make
from tests.support.quick_planners import quick


def assert_same(flight: Flight, plan: Plan) -> None:
    assert flight.outcome is plan.status.outcome
    np.testing.assert_array_equal(flight.control, plan.control)
    assert flight.refused is None


@pytest.mark.parametrize("field", ["sparse/train:0-4", "standard/train:0-6", "traps/train:0"])
def test_flying_single_start_is_its_plan(field: str) -> None:
    planner = make("single-start")
    for flown in get_fields(field):
        plan = planner.plan(flown, initial_state(flown), 0)
        assert_same(fly(ReplanningPolicy(planner), flown, 0, name="single-start"), plan)


def test_flying_into_a_dead_end_is_its_plan() -> None:
    # the start touches a disc and faces its centre: nothing leaves it
    disc = Obstacles.discs([[5.0, 0.0]], [5.0])
    field = Field(name="head-on", obstacles=disc, start_derivative=np.array([5.0, 0.0]))
    plan = make("single-start").plan(field, initial_state(field), 0)
    assert plan.status is Status.STUCK
    assert_same(fly(ReplanningPolicy(make("single-start")), field, 0, name="single-start"), plan)


@pytest.mark.parametrize("planner", PLANNERS)
def test_flying_any_planner_is_its_plan_replanned_or_tracked(planner: str) -> None:
    seed = 1
    field = get_field("sparse/train:3")
    plan = quick(planner).plan(field, initial_state(field), seed)
    assert_same(fly(planner_policy(quick(planner)), field, seed, name=planner), plan)
    tracked = fly(TrackingPolicy(quick(planner)), field, seed, name=planner)
    np.testing.assert_allclose(tracked.control, plan.control, rtol=0, atol=1e-9)
    if plan.success:
        assert tracked.success


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["standard", "dense", "forest", "traps"])
def test_flying_multi_start_is_its_plan_on_many_fields_and_seeds(suite: str) -> None:
    planner = make("multi-start")
    for seed in range(3):
        field = get_field(f"{suite}/train:{seed}")
        plan = planner.plan(field, initial_state(field), seed)
        assert_same(fly(planner_policy(planner), field, seed, name="multi-start"), plan)


def test_seeds_change_the_random_starts_and_repeat() -> None:
    field = get_field("sparse/train:2")
    planner = RecedingHorizon(random_starts=2)
    first, again, other = (
        fly(ReplanningPolicy(planner), field, seed, name="multi-start") for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(first.control, again.control)
    assert [d.report.objective for d in first.decisions] != [
        d.report.objective for d in other.decisions
    ]


def test_a_policy_can_fly_one_field_after_another() -> None:
    policy = make_policy("single-start")
    names = ["sparse/train:0", "sparse/train:1", "sparse/train:0"]
    flights = [fly(policy, get_field(name)) for name in names]
    np.testing.assert_array_equal(flights[0].control, flights[2].control)
    assert len(flights[1].decisions) == len(flights[1].decision_seconds)


def test_an_unknown_policy_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="unknown policy 'ace'; policies are single-start"):
        make_policy("ace")
