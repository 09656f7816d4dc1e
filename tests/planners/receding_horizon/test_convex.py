"""The convex planner: certified flights within its bound on programs, from any state."""

import dataclasses

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Plan, State, Status, initial_state
from planners.optimization.convex import Caps, ChainSolver, Effort, extended_plan, nominal_chain
from planners.receding_horizon.convex import Convex
from planners.registry import make

CONVEX = Convex()


def gap(plan: Plan, field: Field) -> float:
    assert plan.certificates is not None
    exact = exact_length(field)
    assert exact is not None
    return sum(float(one.length) for one in plan.certificates) / exact - 1.0


@pytest.mark.parametrize("name", ["convex", "convex-path"])
def test_flights_are_certified_and_close_to_the_shortest_path(name: str) -> None:
    planner, gaps = make(name), []
    for suite, last in (("standard", 9), ("dense", 4), ("traps", 4)):
        for field in get_fields(f"{suite}/train:0-{last}"):
            plan = planner.plan(field, initial_state(field), 0)
            assert plan.status is Status.SOLVED, field.name
            gaps.append(gap(plan, field))
    assert min(gaps) >= -1e-6
    assert np.median(gaps) < 3e-4
    assert max(gaps) < 2e-3


def test_a_decision_solves_no_more_programs_than_it_says() -> None:
    for field in get_fields("standard/train:10-14"):
        plan = CONVEX.plan(field, initial_state(field), 0)
        programs = [decision.report.rounds for decision in plan.decisions]
        assert max(programs) <= CONVEX.programs
        # mostly one around the rest of the last plan is enough
        assert np.mean(np.array(programs) <= 1) > 0.7


def test_effort_is_counted_and_capped() -> None:
    field = get_field("dense/train:0")
    vehicle = transition.initial_state(field)
    nominal = nominal_chain(field, vehicle, 6.0, 3)
    assert nominal is not None
    found, effort = ChainSolver(rounds=2, enough=-1.0).solve(field, vehicle, nominal, 3)
    assert found is not None
    assert effort.programs == 2
    assert 0 < effort.rows <= 800
    assert 0 < effort.iterations <= 250
    few = ChainSolver(caps=Caps(rows=20)).solve(field, vehicle, nominal, 3)
    assert few == (None, Effort())


def test_a_window_begins_with_the_rest_of_the_last_plan() -> None:
    field = get_field("standard/train:2")
    first = CONVEX.decide(field, initial_state(field), 0)
    assert first.chain is not None
    assert first.first_step is not None
    vehicle, tail = first.first_step.state, first.chain[1:]
    nominal = extended_plan(field, vehicle, tail, 7.0, 4)
    assert nominal is not None
    np.testing.assert_array_equal(nominal.control[:3, 1], tail[:, 1])
    np.testing.assert_array_equal(nominal.control[0, 0], vehicle.position)
    assert len(nominal.control) == 4
    second = CONVEX.decide(field, State(vehicle, tail), 0)
    assert second.report.rounds == 1


def test_a_plan_that_ends_on_the_goal_is_flown() -> None:
    field = get_field("standard/train:2")
    plan = CONVEX.plan(field, initial_state(field), 0)
    programs = [decision.report.rounds for decision in plan.decisions]
    assert programs[-CONVEX.segments + 1 :] == [0] * (CONVEX.segments - 1)


def test_the_rest_of_a_plan_is_flown_where_no_program_is_solved() -> None:
    field = get_field("standard/train:0")
    first = CONVEX.decide(field, initial_state(field), 0)
    assert first.chain is not None
    step = transition.fly_segment(field, initial_state(field).vehicle, first.chain[0])
    blind = dataclasses.replace(CONVEX, solver=ChainSolver(caps=Caps(rows=20)))
    second = blind.decide(field, State(step.state, first.chain[1:]), 0)
    assert second.report.start == "planned"
    assert second.chain is not None
    np.testing.assert_array_equal(second.chain[:, 3], first.chain[1:, 3])
    assert blind.decide(field, initial_state(field), 0).chain is None


def test_without_a_path_there_is_no_decision() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = 6.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    walled = Field(name="ring", obstacles=Obstacles.discs(ring, np.full(16, 2.0)))
    plan = CONVEX.plan(walled, initial_state(walled), 0)
    assert plan.status is Status.STUCK
    assert plan.decisions[0].report.rounds == 0


def test_few_segments_left_make_long_ones() -> None:
    field = get_field("sparse/train:1").with_limits(segments=14)
    plan = CONVEX.plan(field, initial_state(field), 0)
    assert plan.status is Status.SOLVED
    assert len(plan.control) <= 14


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_fields_of_other_scales_fly_alike(scale: float) -> None:
    field = get_field("standard/train:3")
    scaled = Field(
        name="scaled",
        obstacles=field.obstacles.rescaled(np.zeros(2), scale),
        start=scale * field.start,
        goal=scale * field.goal,
        bounds=scale * field.bounds,
        limits={"longest": 15.0 * scale},
    )
    plans = [CONVEX.plan(one, initial_state(one), 0) for one in (field, scaled)]
    assert all(plan.success for plan in plans)
    assert gap(plans[1], scaled) == pytest.approx(gap(plans[0], field), abs=1e-5)


@pytest.mark.parametrize("wrapped", ["+sensing=20", "+margin=0.5", "+backtrack"])
def test_it_flies_with_a_sensing_range_a_margin_or_backtracking(wrapped: str) -> None:
    planner = make("convex" + wrapped)
    for name in ("standard/train:3", "traps/train:2", "town/train:1"):
        field = get_field(name)
        plan = planner.plan(field, initial_state(field), 0)
        assert plan.success, name
        assert is_feasible(plan.control, field).all()
