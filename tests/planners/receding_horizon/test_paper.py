"""The paper's planner: what it reports is feasible, and replanning continues a plan."""

from dataclasses import replace

import numpy as np
import pytest

from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import inspect, is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import State, Status, initial_state
from planners.optimization.certification import TARGET_TOLERANCE
from planners.optimization.initial_guesses import no_guess, random_chains, shifted, straight_ahead
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.slsqp import Slsqp
from planners.receding_horizon.paper import RecedingHorizon
from planners.registry import make
from tests.support.checked_plans import assert_may_be_flown, planned

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


NAMES = ("sparse/train:0", "sparse/train:1", "traps/train:0")


@pytest.mark.parametrize("name", NAMES[:2])
def test_multi_start_reaches_the_goal_of_sparse_fields(name: str) -> None:
    plan = planned("multi-start", name)
    assert 10 <= len(plan.control) <= 12
    assert plan.path is not None
    assert plan.path.length < 1.1 * get_field(name).distance


def test_every_window_is_reported() -> None:
    plan = planned("multi-start", "sparse/train:0")
    assert [decision.report.step for decision in plan.decisions] == list(range(len(plan.control)))
    first, last = plan.decisions[0].report, plan.decisions[-1].report
    assert first.start == "straight" or first.start.startswith("random")
    assert 1 < first.feasible <= first.starts <= 11
    assert not first.final
    assert [d.report.final for d in plan.decisions].count(True) == 1
    assert first.evaluations > first.starts
    assert first.seconds > 0.0
    assert first.solver_status == "converged"
    assert last.start == "planned"
    assert last.starts == 0
    assert plan.evaluations == sum(d.report.evaluations for d in plan.decisions)


def test_an_open_field_is_flown_straight() -> None:
    plan = make("single-start").plan(OPEN, initial_state(OPEN), 0)
    assert plan.success
    assert plan.path is not None
    assert plan.path.length == pytest.approx(OPEN.distance, rel=1e-6)
    assert len(plan.control) == 10


def test_a_walled_in_start_is_stuck() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = Obstacles.discs(
        6.0 * np.column_stack([np.cos(angles), np.sin(angles)]), np.full(16, 2.0)
    )
    plan = RecedingHorizon(random_starts=2).plan(
        walled := Field(name="ring", obstacles=ring), initial_state(walled), 0
    )
    assert plan.status in (Status.STUCK, Status.OUT_OF_SEGMENTS)
    assert plan.path is None
    assert is_feasible(plan.control, walled).all()


def test_a_flight_ends_when_its_segments_are_used_up() -> None:
    few = OPEN.with_limits(segments=4)
    plan = RecedingHorizon(random_starts=0).plan(few, initial_state(few), 0)
    assert plan.status is Status.OUT_OF_SEGMENTS
    assert len(plan.control) == 4


def test_hundreds_of_obstacles_and_none_within_reach() -> None:
    stream = np.random.default_rng(0)
    far = Obstacles.discs(stream.uniform([60.0, 5.0], [95.0, 40.0], (300, 2)), np.full(300, 1.0))
    field = Field(name="far", obstacles=far)
    plan = make("single-start").plan(field, initial_state(field), 0)
    assert plan.success
    assert_may_be_flown(plan, field)


def test_starts_are_the_plan_and_as_many_random_feasible_chains() -> None:
    field = get_field("sparse/train:0")
    state, planner = initial_state(field), RecedingHorizon(random_starts=4)
    window = planner.window(field, state.vehicle)
    batches = list(planner.starts(window, state, 7))
    names = [[name for name, _ in batch] for batch in batches]
    drawn = [f"random {k}" for k in range(1, 5)]
    assert names == [["straight", *drawn], drawn, drawn]
    np.testing.assert_array_equal(batches[0][0][1], straight_ahead(state.vehicle, 3, PAPER_LIMITS))
    randoms = np.array([guess for batch in batches for name, guess in batch if name in drawn])
    assert window.admits(randoms).all()
    assert len({guess.tobytes() for guess in randoms}) == len(randoms)
    again = [guess for batch in planner.starts(window, state, 7) for _, guess in batch]
    np.testing.assert_array_equal(again[1:5], randoms[:4])
    flown = State(
        transition.State(field.start, field.departure, 1),
        straight_ahead(state.vehicle, 2, PAPER_LIMITS),
    )
    ((name, guess), *_), *_ = planner.starts(window, flown, 7)
    assert name == "shifted"
    np.testing.assert_array_equal(guess, shifted(flown.vehicle, flown.tail, 3))


def test_more_chains_are_drawn_while_all_starts_fail() -> None:
    counts = []

    def drawn(stream: np.random.Generator, *sizes: object) -> np.ndarray:
        counts.append(sizes[-1])
        return random_chains(stream, *sizes)

    planner = RecedingHorizon(random_starts=3, draws=2, random_guess=drawn)
    state = initial_state(OPEN)
    batches = planner.starts(planner.window(OPEN, state.vehicle), state, 0)
    assert next(batches)
    assert counts == [6]
    assert len([*batches]) == 2
    assert counts == [6, 60, 600]


def test_without_random_starts_there_is_one() -> None:
    state, planner = initial_state(OPEN), RecedingHorizon(random_starts=0)
    batches = list(planner.starts(planner.window(OPEN, state.vehicle), state, 0))
    assert [[name for name, _ in batch] for batch in batches] == [["straight"]]


def test_all_guesses_may_be_random_and_only_the_first_draws_be_tried() -> None:
    field = get_field("sparse/train:0")
    planner = RecedingHorizon(first_guess=no_guess, random_starts=1, draws=100, redraws=())
    state = initial_state(field)
    window = planner.window(field, state.vehicle)
    batches = list(planner.starts(window, state, 0))
    assert [[name for name, _ in batch] for batch in batches] == [["random 1"]]
    plan = planner.plan(field, state, 0)
    assert {decision.report.start for decision in plan.decisions} <= {"random 1", "planned"}
    assert_may_be_flown(plan, field)


def test_without_a_first_guess_no_chain_is_found() -> None:
    planner = RecedingHorizon(first_guess=no_guess, random_starts=0)
    decision = planner.decide(OPEN, initial_state(OPEN), 0)
    assert decision.chain is None
    assert decision.report.starts == 0


@pytest.mark.parametrize("longest", [7.5, 30.0])
def test_segments_keep_the_limits_of_their_field(longest: float) -> None:
    limits = replace(PAPER_LIMITS, longest=longest, segments=80)
    field = replace(get_field("sparse/train:0"), limits=limits)
    plan = RecedingHorizon(random_starts=0).plan(field, initial_state(field), 0)
    assert plan.success
    control = plan.control
    assert is_feasible(control, field).all()
    np.testing.assert_array_equal(control[0, 0], field.start)
    np.testing.assert_array_equal(control[0, 2], field.departure)
    np.testing.assert_array_equal(control[1:, (0, 2)], control[:-1, (1, 3)])
    np.testing.assert_array_equal(control[-1, 1], field.goal)
    assert longest / 1.5 < inspect(control, field).length.max() <= longest + limits.tolerance


@pytest.mark.parametrize(
    ("distance", "segments"), [(2.0, 1), (5.9, 1), (6.1, 2), (9.1, 3), (80, 3)]
)
def test_near_the_goal_fewer_segments_are_planned(distance: float, segments: int) -> None:
    vehicle = transition.State(OPEN.goal - [0.0, distance], np.array([0.0, 5.0]))
    assert RecedingHorizon().window(OPEN, vehicle).chain.segments == segments


@pytest.mark.parametrize("number", range(1, 5))
def test_past_its_deadline_a_planner_flies_the_best_it_has(number: int) -> None:
    field = get_field(f"paper:{number}")
    hasty, patient = RecedingHorizon(deadline=1e-9), RecedingHorizon()
    decision = hasty.decide(field, initial_state(field), 0)
    assert decision.report.cut_short
    if decision.chain is not None:
        assert is_feasible(decision.chain, field, tolerance=TARGET_TOLERANCE).all()
        better = patient.decide(field, initial_state(field), 0).report
        assert not better.cut_short
        assert better.objective <= decision.report.objective
    plan = hasty.plan(field, initial_state(field), 0)
    assert is_feasible(plan.control, field).all()
    assert all(d.report.cut_short or d.report.start == "planned" for d in plan.decisions)


def test_past_its_deadline_a_planner_without_a_chain_flies_the_rest_of_its_plan() -> None:
    vehicle = transition.initial_state(OPEN)
    chain = straight_ahead(vehicle, 3, PAPER_LIMITS)
    # the shifted plan ends in a segment without length: no start is feasible
    state = State(transition.State(chain[0, 1], chain[0, 3], 1), chain[1:])
    decision = RecedingHorizon(random_starts=0, deadline=1e-9).decide(OPEN, state, 0)
    assert decision.report.start == "planned"
    assert decision.report.cut_short
    np.testing.assert_array_equal(decision.chain, chain[1:])


def test_a_planner_takes_any_solver_of_windows() -> None:
    planner = RecedingHorizon(random_starts=0, solver=ByExchange(Slsqp()))
    field = get_field("sparse/train:0")
    plan = planner.plan(field, initial_state(field), 0)
    assert plan.success
    assert_may_be_flown(plan, field)


def test_clearance_of_a_plan_is_contact_or_more() -> None:
    plan = planned("multi-start", "sparse/train:0")
    assert inspect(plan.control, get_field("sparse/train:0")).clearance.min() >= -1e-5
