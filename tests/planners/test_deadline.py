"""Deadlines: what is planned when the time is up is a certified path, as long as possible."""

import time

import numpy as np
import pytest

import planners
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, get_field, is_feasible
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners import Decision, Plan, State, Status, make
from planners.contract import _check_plan
from planners.deadline import check_deadline, plan_within
from planners.interface import Replanner, initial_state
from planners.receding_horizon import Guided
from planners.rollout import StepByStep

FIELD = get_field("dense/train:1")
START = initial_state(FIELD)


class Timed(StepByStep):
    """A planner during whose last decision the time runs out."""

    def __init__(self, planner: Replanner, decisions: int) -> None:
        self.planner, self.left = planner, decisions

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        self.left -= 1
        decision = self.planner.decide(field, state, seed)
        if self.left == 0:
            time.sleep(0.3)
        return decision


def stopped(planner: Replanner, decisions: int) -> Plan:
    """The plan of a planner that is stopped after some decisions."""
    planner.plan(FIELD, START, 0)  # compiles
    plan = plan_within(Timed(planner, decisions), FIELD, START, 0, 0.3)
    assert len(plan.decisions) == decisions
    return plan


def test_the_rest_of_the_last_decision_is_flown() -> None:
    plan = stopped(Guided(), 2)
    chain = plan.decisions[-1].chain
    assert chain is not None
    assert plan.status is Status.OUT_OF_TIME
    assert plan.path is None
    assert len(plan.control) == 1 + len(chain) > 2
    np.testing.assert_allclose(plan.control[1:], chain, atol=1e-5)
    _check_plan(plan, FIELD, START)


def test_a_rest_that_ends_on_the_goal_completes_the_plan() -> None:
    whole = Guided().plan(FIELD, START, 0)
    ends = [one.chain[-1, 1] for one in whole.decisions if one.chain is not None]
    first = int((ends == FIELD.goal).all(axis=1).argmax())
    plan = stopped(Guided(), first + 1)
    assert first + 1 < len(whole.control)
    assert plan.status is Status.SOLVED
    np.testing.assert_array_equal(plan.control, whole.control)
    _check_plan(plan, FIELD, START)


def test_segments_among_unknown_obstacles_are_not_flown() -> None:
    sensing = make("guided+sensing=20")
    assert isinstance(sensing, Replanner)
    plan = stopped(sensing, 2)
    assert (plan.status, len(plan.control)) == (Status.OUT_OF_TIME, 2)


def test_the_rest_keeps_the_turn_radius_and_the_number_of_segments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    radius = 8.0
    planner = make("guided+turn=8")
    assert isinstance(planner, Guided)
    chains: list[Array] = []
    decide = Guided.decide

    def spoiled(self: Guided, field: Field, state: State, seed: int) -> Decision:
        decision = decide(self, field, state, seed)
        assert decision.chain is not None
        chains.append(decision.chain)
        decision.chain[2:, 3] *= 0.05  # a sharp turn, far from obstacles
        time.sleep(0.3)
        return decision

    monkeypatch.setattr(Guided, "decide", spoiled)
    plan = plan_within(planner, FIELD, START, 0, 0.3)
    assert plan.status is Status.OUT_OF_TIME
    assert keeps_turn_radius(plan.control, radius, FIELD.limits.tolerance).all()
    assert len(plan.control) == 2 < len(chains[0])


@pytest.mark.parametrize("name", ["multi-start", "single-start", "guided", "pursuit"])
def test_no_time_gives_no_segment_and_plenty_gives_the_whole_plan(name: str) -> None:
    planner = make(name)
    plan = plan_within(planner, FIELD, START, 0, 1e-9)
    assert (plan.status, len(plan.control)) == (Status.OUT_OF_TIME, 0)
    field = get_field("sparse/train:0")
    whole = planner.plan(field, initial_state(field), 0)
    plan = plan_within(planner, field, initial_state(field), 0, 3600.0)
    assert plan.status is whole.status
    np.testing.assert_array_equal(plan.control, whole.control)


def test_multi_start_ends_its_search_in_time() -> None:
    planner = make("multi-start")
    planner.plan(FIELD, START, 0)  # compiles
    whole = planner.plan(FIELD, START, 0)
    seconds = 0.6 * whole.step_seconds[0]
    plan = plan_within(planner, FIELD, START, 0, seconds)
    assert plan.decisions[0].report.cut_short
    assert plan.status is Status.OUT_OF_TIME
    assert is_feasible(plan.control, FIELD).all()


def test_planners_without_a_budget_cannot_stop() -> None:
    for name in ("shortest", "voronoi"):
        with pytest.raises(ValueError, match=f"planner {name} cannot stop at a deadline; .*guided"):
            planners.plan(FIELD, name, deadline=1.0)
    with pytest.raises(ValueError, match="planner WholePath cannot stop"):
        check_deadline(make("shortest"))
    with pytest.raises(ValueError, match="a deadline is a number of seconds above 0, got 0"):
        planners.plan(FIELD, deadline=0.0)
    assert planners.plan("sparse/train:0", deadline=3600.0).success


def test_a_search_within_a_budget_ends_in_time() -> None:
    pytest.importorskip("ompl")
    planner = make("rrt-star")
    plan_within(planner, FIELD, START, 0, 0.01)  # starts the library
    began = time.perf_counter()
    plan = plan_within(planner, FIELD, START, 0, 0.2)
    assert 0.2 < time.perf_counter() - began < 2.0
    assert plan.success
    plan = plan_within(planner, FIELD, START, 0, 1e-6)
    assert plan.status in (Status.SOLVED, Status.OUT_OF_TIME)
