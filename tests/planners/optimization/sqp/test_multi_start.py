"""Solvers of windows: what they call feasible is, whatever the window."""

import math
import time
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State, initial_state
from planners import interface
from planners.optimization.certification import TARGET_TOLERANCE, Certified, WindowSolver
from planners.optimization.initial_guesses import straight_ahead
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.sqp.elastic_sqp import (
    ABANDONED,
    CONVERGED,
    DEADLINE,
    ElasticSqp,
    Search,
    SearchState,
)
from planners.optimization.sqp.multi_start import MultiStart, offset_guesses
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window
from planners.receding_horizon.paper import RecedingHorizon
from planners.registry import make
from tests.support.random_windows import GUESSES, NUMBERS, PLACES, SPEEDS, Case, random_case

SOLVERS: dict[str, WindowSolver] = {"ours": MultiStart(), "slsqp": ByExchange(Slsqp())}
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


@dataclass(frozen=True, eq=False)
class Task:
    window: Window
    guesses: list[np.ndarray]


@cache
def tasks(number: int) -> list[Task]:
    """Windows of a flight through one of the paper's fields: early, midway, near the goal."""
    field, planner = get_field(f"paper:{number}"), RecedingHorizon()
    plan = make("guided").plan(field, interface.initial_state(field), 0)
    found = []
    for step in (0, 3, 6):
        state = plan.states[step]
        window = planner.window(field, state.vehicle)
        starts = next(planner.starts(window, state, 0))
        found.append(Task(window, [guess for _, guess in starts]))
    return found


def window_from(
    field: Field, vehicle: State | None = None, segments: int = 3, final: bool = False
) -> Window:
    make_window = final_window if final else horizon_window
    vehicle = initial_state(field) if vehicle is None else vehicle
    return make_window(field, vehicle, WindowSettings(), segments)


def assert_honest(window: Window, end: Certified) -> None:
    """Finite, and feasible where it says so."""
    assert np.isfinite(end.control).all()
    assert np.isfinite(end.solution.x).all()
    assert math.isfinite(end.solution.objective)
    np.testing.assert_array_equal(window.chain.control(end.solution.x), end.control)
    assert end.feasible == is_feasible(end.control, window.field, TARGET_TOLERANCE).all()
    assert 1 <= end.rounds <= 12
    assert 1 <= end.solution.evaluations <= end.evaluations
    assert end.seconds >= 0.0


def best(ends: list[Certified]) -> float:
    return min((end.solution.objective for end in ends if end.feasible), default=math.inf)


def facts(ends: list[Certified]) -> list[tuple[object, ...]]:
    """All that no clock decides."""
    return [
        (
            end.control.tobytes(),
            end.solution.x.tobytes(),
            end.solution.objective,
            end.solution.status,
            end.evaluations,
            end.rounds,
            end.feasible,
        )
        for end in ends
    ]


@pytest.mark.parametrize("number", range(1, 5))
@pytest.mark.parametrize("solver", SOLVERS)
def test_windows_of_the_papers_fields_are_solved_honestly(solver: str, number: int) -> None:
    for task in tasks(number):
        guesses = task.guesses[:4]
        ends = SOLVERS[solver].solve(task.window, guesses)
        assert len(ends) == len(guesses)
        for end in ends:
            assert_honest(task.window, end)
            if end.feasible:
                flown = float(length(end.control).sum())
                f = float(task.window.objective.value(flown, end.control[-1, 1]))
                assert end.solution.objective == pytest.approx(f, rel=3e-4)
        assert best(ends) < math.inf


@pytest.mark.parametrize("number", range(1, 5))
def test_where_we_converge_slsqp_finds_no_way_down_close_by(number: int) -> None:
    close = 0
    for task in tasks(number):
        for end in MultiStart(sidesteps=()).solve(task.window, task.guesses[:3]):
            if not end.feasible or end.solution.status != CONVERGED:
                continue
            (further,) = ByExchange(Slsqp()).solve(task.window, [end.control])
            if further.feasible and abs(further.solution.x - end.solution.x).max() < 3.0:
                ours, theirs = end.solution.objective, further.solution.objective
                assert theirs >= ours - 1e-3 * max(ours, 1.0)
                close += 1
    assert close >= 3


@pytest.mark.parametrize("threads", [2, 3, 100])
@pytest.mark.parametrize("number", range(1, 5))
def test_results_do_not_depend_on_threads_or_on_what_was_solved_before(
    number: int, threads: int
) -> None:
    for task in tasks(number):
        alone = facts(MultiStart().solve(task.window, task.guesses))
        assert facts(MultiStart().solve(task.window, task.guesses)) == alone
        assert facts(MultiStart(threads=threads).solve(task.window, task.guesses)) == alone


def test_a_start_is_searched_the_same_whichever_came_before() -> None:
    (task, *_) = tasks(2)
    patient = MultiStart(search=ElasticSqp(patience=math.inf), sidesteps=())
    forth = facts(patient.solve(task.window, task.guesses))
    back = facts(patient.solve(task.window, task.guesses[::-1]))
    assert back[::-1] == forth


@pytest.mark.parametrize("number", range(1, 5))
def test_a_sidestep_never_worsens_the_best(number: int) -> None:
    for task in tasks(number):
        stay = MultiStart(sidesteps=()).solve(task.window, task.guesses)
        aside = MultiStart().solve(task.window, task.guesses)
        assert len(aside) == len(stay)
        assert best(aside) <= best(stay)
        improved = [k for k in range(len(stay)) if facts(aside)[k][:3] != facts(stay)[k][:3]]
        assert len(improved) <= 1
        for end in aside:
            assert_honest(task.window, end)


@pytest.mark.parametrize("number", range(1, 5))
def test_patience_costs_nothing_but_time(number: int) -> None:
    patient = MultiStart(search=ElasticSqp(patience=math.inf))
    for task in tasks(number):
        hasty = best(MultiStart().solve(task.window, task.guesses))
        ends = patient.solve(task.window, task.guesses)
        assert best(ends) <= hasty + 1e-3 * max(hasty, 1.0)
        assert ABANDONED not in {end.solution.status for end in ends}


@pytest.mark.parametrize("at", [4.3, 4.7, 5.5, 9.6, 14.2])
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_small_disc_between_samples_is_avoided(solver: str, at: float) -> None:
    radius = 0.02
    field = Field(name="pin", obstacles=Obstacles.discs([[at, at]], [radius]))
    window = window_from(field)
    guess = straight_ahead(initial_state(field), 3, PAPER_LIMITS)
    ends = SOLVERS[solver].solve(window, [guess])
    assert best(ends) < math.inf
    for end in ends:
        assert_honest(window, end)
        away = evaluate(end.control, np.linspace(0.0, 1.0, 100_001)) - [at, at]
        assert not end.feasible or np.linalg.norm(away, axis=-1).min() >= radius - 2e-6


@pytest.mark.parametrize("distance", [3.2, 4.0, 8.0, 14.0, 25.0, 40.0])
@pytest.mark.parametrize("disc", [False, True])
def test_a_goal_within_reach_is_reached_exactly(distance: float, disc: bool) -> None:
    position = OPEN.goal - distance / np.sqrt(2.0)
    middle = 0.5 * (position + OPEN.goal)
    discs = Obstacles.discs([middle], [0.1 * distance]) if disc else OPEN.obstacles
    field = Field(name="near", obstacles=discs)
    vehicle = State(position, np.array([4.0, 4.0]))
    segments = max(1, min(3, int(distance / 3.0)))
    window = window_from(field, vehicle, segments)
    (end,) = MultiStart().solve(window, [straight_ahead(vehicle, segments, PAPER_LIMITS)])
    assert_honest(window, end)
    assert end.feasible
    assert end.solution.converged
    assert np.linalg.norm(end.control[-1, 1] - field.goal) < 1e-8
    assert end.solution.objective < 1e-7


@pytest.mark.parametrize("final", [False, True])
@pytest.mark.parametrize("limits", [{"longest": 8.0}, {"shortest": 11.0}, {"slowest": 2.0}])
def test_limits_hold_for_the_certified_length_and_the_whole_curve(
    limits: dict[str, float], final: bool
) -> None:
    some = replace(PAPER_LIMITS, **limits)
    discs = Obstacles.discs([[8.0, 7.0]], [3.0])
    field = Field(name="disc", obstacles=discs, goal=[14.0, 13.0], limits=some)
    make_window = final_window if final else horizon_window
    window = make_window(field, initial_state(field), WindowSettings(), 3)
    guesses = [
        straight_ahead(initial_state(field), 3, some),
        straight_ahead(initial_state(field), 3, PAPER_LIMITS),
    ]
    ends = MultiStart().solve(window, guesses)
    assert best(ends) < math.inf
    for end in ends:
        assert_honest(window, end)
        if end.feasible:
            assert (length(end.control) >= some.shortest - TARGET_TOLERANCE).all()
            assert (length(end.control) <= some.longest + TARGET_TOLERANCE).all()


@pytest.mark.parametrize("final", [False, True])
@pytest.mark.parametrize("number", range(1, 5))
def test_after_the_deadline_starts_are_returned_as_they_are(number: int, final: bool) -> None:
    task = tasks(number)[0]
    vehicle = State(task.window.chain.knots[0, 0], task.window.chain.knots[0, 1])
    window = window_from(task.window.field, vehicle, final=final)
    MultiStart().solve(window, task.guesses[:1])
    began = time.perf_counter()
    ends = MultiStart().solve(window, task.guesses, began - 1.0)
    assert time.perf_counter() - began < 0.5
    assert len(ends) == len(task.guesses)
    for end, guess in zip(ends, task.guesses, strict=True):
        assert_honest(window, end)
        assert end.solution.status == DEADLINE
        assert not end.solution.converged
        x = np.clip(window.chain.unknowns(guess), *window.box)
        np.testing.assert_array_equal(end.solution.x, x)


def test_by_exchange_solves_at_least_once_whatever_the_deadline() -> None:
    task = tasks(4)[0]
    ends = ByExchange(Slsqp()).solve(task.window, task.guesses, time.perf_counter() - 1.0)
    assert len(ends) == 1
    assert_honest(task.window, ends[0])


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_guesses_give_no_ends(solver: str) -> None:
    assert SOLVERS[solver].solve(window_from(OPEN), []) == []


def test_a_guess_that_is_not_a_number_is_refused() -> None:
    guess = straight_ahead(initial_state(OPEN), 3, PAPER_LIMITS)
    guess[1, 3, 0] = math.nan
    with pytest.raises(ValueError, match="a guess must be finite"):
        MultiStart().solve(window_from(OPEN), [guess])


def test_certification_adds_the_contacts_it_finds_broken() -> None:
    field = Field(name="two", obstacles=Obstacles.discs([[4.7, 4.7], [30.0, 5.0]], [0.5, 1.0]))
    window = window_from(field)
    chain = straight_ahead(initial_state(field), 3, PAPER_LIMITS)
    search = Search(ElasticSqp(), window, math.inf)
    state = SearchState(window.chain.unknowns(chain), search.fresh, status=CONVERGED)
    assert search.pin_contacts(state, chain)
    ((segment, disc, t),) = state.layout.pinned_contacts
    (nearest,) = evaluate(chain[int(segment)], [t])
    assert disc == 0.0
    np.testing.assert_allclose(nearest, [4.7, 4.7], atol=1e-6)
    search.resume(state, math.inf)
    assert state.rounds == 1
    assert is_feasible(window.chain.control(state.x), field, tolerance=TARGET_TOLERANCE).all()
    assert not search.pin_contacts(state, window.chain.control(state.x))
    assert not search.pin_contacts(replace(state, status=DEADLINE), chain)


def test_a_sidestep_leans_to_both_sides_and_keeps_the_start() -> None:
    chain = straight_ahead(initial_state(OPEN), 3, PAPER_LIMITS)
    for side, sign in zip(offset_guesses(chain, 8.0), (-1.0, 1.0), strict=True):
        np.testing.assert_array_equal(side[0, (0, 2)], chain[0, (0, 2)])
        np.testing.assert_allclose(side[1:, (0, 2)], side[:-1, (1, 3)], atol=1e-12)
        off = side[-1, 1] - chain[-1, 1]
        np.testing.assert_allclose(off, sign * 8.0 * np.array([-1.0, 1.0]) / np.sqrt(2.0))


MOST_EVALUATIONS = 2000
"""Of one start, a sidestep's two included; about eight times what is usual at worst."""


def assert_robust(window: Window, guesses: list[np.ndarray]) -> list[Certified]:
    ends = MultiStart().solve(window, guesses)
    assert len(ends) == len(guesses)
    for end in ends:
        assert_honest(window, end)
        assert end.evaluations < MOST_EVALUATIONS
    return ends


cases = st.builds(
    Case,
    seed=st.integers(0, 2**32 - 1),
    discs=st.sampled_from(NUMBERS),
    place=st.sampled_from(PLACES),
    speed=st.sampled_from(SPEEDS),
    guess=st.sampled_from(GUESSES),
    segments=st.integers(1, 4),
    final=st.booleans(),
    bending_weight=st.sampled_from([0.0, 0.01]),
    shaped=st.booleans(),
)


@given(cases)
@settings(deadline=None, max_examples=500, derandomize=True)
def test_any_window_from_any_guess_ends_honestly(case: Case) -> None:
    window, guess = case.draw()
    assert_robust(window, [guess])


@pytest.mark.slow
def test_ten_thousand_windows_end_honestly() -> None:
    stream = np.random.default_rng(2024)
    feasible = 0
    for _ in range(10_000):
        case = random_case(stream)
        window, guess = case.draw()
        usual = straight_ahead(
            State(guess[0, 0], np.array([3.0, 4.0])), case.segments, PAPER_LIMITS
        )
        feasible += any(end.feasible for end in assert_robust(window, [guess, usual]))
    assert feasible > 500
