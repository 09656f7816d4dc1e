"""Two steps: the distance alone, then the length to where that ends."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field_names import get_field
from planners.interface import initial_state
from planners.optimization.certification import Certified
from planners.optimization.reference.two_stage import TwoSteps
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import Window, WindowSettings, final_window
from planners.receding_horizon.paper import RecedingHorizon

SEARCH = MultiStart(sidesteps=())


@cache
def windows() -> list[tuple[Window, list[np.ndarray]]]:
    """Those of a flight that do not end on the goal, with their first guesses."""
    field, planner = get_field("standard/validation:3"), RecedingHorizon(solver=SEARCH)
    plan = planner.plan(field, initial_state(field), 0)
    found = []
    for state, decision in zip(plan.states, plan.decisions, strict=False):
        if decision.chain is not None and not np.array_equal(decision.chain[-1, 1], field.goal):
            window = planner.window(field, state.vehicle)
            starts = next(planner.starts(window, state, 0))
            found.append((window, [guess for _, guess in starts]))
    assert len(found) > 3
    return found


def best(ends: list[Certified]) -> Certified:
    return min((end for end in ends if end.feasible), key=lambda end: end.solution.objective)


def test_the_end_is_that_of_the_distance_alone_and_the_way_there_no_longer() -> None:
    shortened = 0.0
    for window, guesses in windows():
        nearest = replace(window, objective=replace(window.objective, alpha=0.0))
        first = best(SEARCH.solve(nearest, guesses))
        second = best(TwoSteps(search=SEARCH).solve(window, guesses))
        np.testing.assert_allclose(second.control[-1, 1], first.control[-1, 1], atol=1e-9)
        distance = np.linalg.norm(second.control[-1, 1] - window.field.goal)
        assert second.solution.objective == pytest.approx(float(distance), abs=1e-6)
        saved = float(length(first.control).sum() - length(second.control).sum())
        assert saved > -1e-5
        shortened += saved
        assert second.evaluations > first.evaluations
        assert is_feasible(second.control, window.field, 1e-6).all()
        np.testing.assert_array_equal(window.chain.control(second.solution.x), second.control)
    assert shortened > 0.01


def test_one_end_for_each_guess_and_the_weight_of_directness_does_not_matter() -> None:
    window, guesses = windows()[1]
    other = replace(window, objective=replace(window.objective, alpha=3.0))
    ends = TwoSteps(search=SEARCH).solve(window, guesses)
    assert len(ends) == len(guesses)
    again = TwoSteps(search=SEARCH).solve(other, guesses)
    for one_end, other_end in zip(ends, again, strict=True):
        np.testing.assert_array_equal(one_end.control, other_end.control)


def test_a_window_that_ends_on_the_goal_is_solved_as_it_is() -> None:
    field = get_field("sparse/train:0")
    state = replace(initial_state(field).vehicle, position=field.goal - 20.0)
    window = final_window(field, state, WindowSettings(), 3)
    guess = windows()[0][1][0]
    (end,) = TwoSteps(search=SEARCH).solve(window, [guess])
    (plain,) = SEARCH.solve(window, [guess])
    np.testing.assert_array_equal(end.control, plain.control)


def test_no_guesses_give_no_ends() -> None:
    assert TwoSteps().solve(windows()[0][0], []) == []


def test_a_planner_flies_with_it() -> None:
    field = get_field("standard/train:3")
    plan = RecedingHorizon(solver=TwoSteps(search=SEARCH)).plan(field, initial_state(field), 0)
    assert plan.success
    assert is_feasible(plan.control, field).all()
