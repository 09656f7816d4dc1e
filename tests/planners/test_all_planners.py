"""Promises that all planners keep, over all names of the registry."""

import numpy as np
import pytest

from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import State, Status, initial_state
from planners.registry import PLANNERS, make
from tests.support.checked_plans import assert_may_be_flown, planned
from tests.support.quick_planners import quick

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


NAMES = ("sparse/train:0", "sparse/train:1", "traps/train:0")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("planner", PLANNERS)
def test_every_success_is_feasible_and_ends_on_the_goal(planner: str, name: str) -> None:
    plan = planned(planner, name)
    # single-start alone is known to be caught, and by the trap only
    assert plan.success or (planner, name) == ("single-start", "traps/train:0")
    if plan.success:
        assert_may_be_flown(plan, get_field(name))
        assert plan.path is not None


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_flight_that_is_over_needs_no_plan(planner: str) -> None:
    plan = planned(planner, "sparse/train:0")
    there = quick(planner).plan(get_field("sparse/train:0"), plan.states[-1], 3)
    assert (there.status, there.path, len(there.control)) == (Status.SOLVED, None, 0)
    late = State(transition.State(OPEN.start, OPEN.departure, PAPER_LIMITS.segments))
    assert quick(planner).plan(OPEN, late, 3).status is Status.OUT_OF_SEGMENTS


@pytest.mark.parametrize("planner", PLANNERS)
def test_replanning_in_the_middle_gives_the_rest_of_the_plan(planner: str) -> None:
    plan = planned(planner, "sparse/train:0")
    middle = len(plan.control) - 4
    again = quick(planner).plan(get_field("sparse/train:0"), plan.states[middle], 3)
    assert again.status is plan.status
    np.testing.assert_array_equal(again.control, plan.control[middle:])


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("distance", [2.2, 2.5, 3.5, 7.0, 10.0, 40.0])
def test_planning_from_near_the_goal(planner: str, distance: float) -> None:
    position = OPEN.goal - distance / np.sqrt(2.0)
    vehicle = transition.State(position, np.array([4.0, 4.0]), 5)
    plan = quick(planner).plan(OPEN, State(vehicle), 0)
    assert plan.success
    assert plan.path is not None
    assert plan.path.length <= max(distance, 3.0) * 1.2


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(
    "options",
    [
        {"bounds": [0, 100], "start_derivative": [-1, 0]},
        {"start": [-10, 50], "start_derivative": [-5, 0]},
        {"start_derivative": [46, 46]},
        {"start_derivative": [-0.1, 0.0]},
    ],
)
def test_a_start_heading_away_is_planned_or_stuck(planner: str, options: dict) -> None:
    field = Field(name="astray", obstacles=Obstacles.discs([[6.0, 6.0]], [5.0]), **options)
    plan = quick(planner).plan(field, initial_state(field), 0)
    assert is_feasible(plan.control, field).all()
    assert plan.success == (plan.path is not None)


def test_an_unknown_planner_is_refused_with_the_known_names() -> None:
    with pytest.raises(ValueError, match="unknown planner 'nobody'; planners are single-start"):
        make("nobody")
