"""Analytic gradients against complex step, the paper's way of taking them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.curves.splines import basis
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.transition import initial_state
from planners.optimization.initial_guesses import random_chains, straight_ahead
from planners.optimization.nonlinear_program import Problem
from planners.optimization.reference.complex_step import ByComplexStep, ComplexStep, complex_step
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.sampled_constraints import ClearanceAt, InsideAt, SpeedAt
from planners.optimization.window import WindowSettings, final_window, horizon_window

FIELD = get_field("paper:1")
SETTINGS = WindowSettings()


def program(final: bool, segments: int = 3, window_settings: WindowSettings = SETTINGS) -> Problem:
    make = final_window if final else horizon_window
    problem = make(FIELD, initial_state(FIELD), window_settings, segments).sampled()
    t = np.array([0.31, 0.77])
    segment, obstacle = np.array([0, segments - 1]), np.array([3, 41])
    return problem.joined_by(
        [
            ClearanceAt(FIELD.obstacles, segment, obstacle, basis(t)),
            SpeedAt(0.1, segment, basis(t, 1)),
            InsideAt(FIELD.bounds, segment, basis(t)),
        ]
    )


def random_unknowns(problem: Problem, seed: int) -> np.ndarray:
    stream = np.random.default_rng(seed)
    (chain,) = random_chains(stream, initial_state(FIELD), problem.chain.segments, PAPER_LIMITS, 1)
    return problem.chain.unknowns(chain + stream.normal(0.0, 1.0, chain.shape))


@pytest.mark.parametrize("bending_weight", [0.0, 0.01])
@pytest.mark.parametrize("final", [False, True])
@given(seed=st.integers(0, 2**32 - 1), segments=st.integers(1, 4))
@settings(deadline=None, max_examples=40, derandomize=True)
def test_analytic_gradients_agree_with_complex_step(
    final: bool, bending_weight: float, seed: int, segments: int
) -> None:
    problem = program(final, segments, WindowSettings(bending_weight=bending_weight))
    x = random_unknowns(problem, seed)
    by_step = ComplexStep(problem)
    for analytic, stepped in (
        (problem.gradient(x), by_step.gradient(x)),
        (problem.jacobian(x), by_step.jacobian(x)),
    ):
        assert analytic.shape == stepped.shape
        scale = np.maximum(np.abs(stepped).max(axis=-1, keepdims=True), 1.0)
        assert (np.abs(analytic - stepped) / scale).max() < 1e-10


def test_complex_step_is_exact_where_differences_are_not() -> None:
    x = np.array([1e-3, 2.0])
    derivative = complex_step(lambda z: np.array([np.exp(z[0]) / z[1], z[0] * z[1] ** 2]), x)
    exact = [
        [np.exp(1e-3) / 2, -np.exp(1e-3) / 4],
        [4.0, 4e-3],
    ]
    np.testing.assert_allclose(derivative, exact, rtol=1e-15)


def test_a_held_goal_is_not_among_the_unknowns() -> None:
    problem = final_window(FIELD, initial_state(FIELD), SETTINGS, 3).sampled()
    x = random_unknowns(problem, 0)
    assert x.shape == (10,)
    np.testing.assert_array_equal(problem.chain.control(x)[-1, 1], FIELD.goal)


def test_unknowns_and_control_are_inverse() -> None:
    problem = horizon_window(FIELD, initial_state(FIELD), SETTINGS, 3).sampled()
    x = random_unknowns(problem, 1)
    assert x.shape == (12,)
    np.testing.assert_array_equal(problem.chain.unknowns(problem.chain.control(x)), x)


def test_the_solver_finds_the_same_minimum_with_either_gradient() -> None:
    problem = horizon_window(FIELD, initial_state(FIELD), SETTINGS, 3).sampled()
    guess = problem.chain.unknowns(straight_ahead(initial_state(FIELD), 3, PAPER_LIMITS))
    analytic = Slsqp().solve(problem, guess)
    stepped = ByComplexStep(Slsqp()).solve(problem, guess)
    assert analytic.converged
    assert stepped.converged
    assert analytic.objective == pytest.approx(stepped.objective, rel=1e-5)
