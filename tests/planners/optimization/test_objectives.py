"""What a window minimises, and its derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimization.objectives import HorizonObjective, LengthObjective, Objective
from planners.optimization.reference.complex_step import complex_step

START, GOAL = np.array([3.0, -2.0]), np.array([100.0, 90.0])
HORIZON = HorizonObjective(START, GOAL, 0.2)
OBJECTIVES = [HORIZON, LengthObjective()]

lengths = st.floats(3.0, 60.0)
points = st.tuples(st.floats(-10.0, 110.0), st.floats(-10.0, 110.0)).map(np.array)


def value(objective: Objective, z: np.ndarray) -> np.ndarray:
    return np.asarray(objective.value(z[0], z[1:]))


@given(length=lengths, end=points)
@settings(deadline=None, max_examples=100, derandomize=True)
def test_the_horizon_objective_is_the_papers_equation(length: float, end: np.ndarray) -> None:
    d, straight = np.linalg.norm(end - GOAL), np.linalg.norm(end - START)
    if straight > 1e-3:
        expected = d * (1.0 + 0.2 * length / straight)
        assert HORIZON.value(length, end) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("objective", OBJECTIVES)
@given(length=lengths, end=points)
@settings(deadline=None, max_examples=100, derandomize=True)
def test_expansions_agree_with_the_value_and_its_derivatives(
    objective: Objective, length: float, end: np.ndarray
) -> None:
    if min(np.linalg.norm(end - START), np.linalg.norm(end - GOAL)) < 0.1:
        return
    z = np.array([length, *end])
    f, gradient, hessian = objective.expand(length, end)
    assert f == pytest.approx(float(value(objective, z)), rel=1e-14)
    stepped = complex_step(lambda z: value(objective, z), z)
    np.testing.assert_allclose(gradient, stepped, atol=1e-12 * (1.0 + abs(stepped).max()))
    step = 1e-5
    beside = np.array(
        [
            (objective.expand(*apart(z + h))[1] - objective.expand(*apart(z - h))[1]) / (2 * step)
            for h in step * np.eye(3)
        ]
    )
    np.testing.assert_allclose(hessian, beside, atol=1e-5 * (1.0 + abs(beside).max()))
    np.testing.assert_allclose(hessian, hessian.T, rtol=1e-14)


def apart(z: np.ndarray) -> tuple[float, np.ndarray]:
    return float(z[0]), z[1:].copy()


@pytest.mark.parametrize("end", [GOAL, START, START + 1e-300, GOAL + 1e-12])
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_at_the_goal_and_at_the_start_everything_is_finite(
    objective: Objective, end: np.ndarray
) -> None:
    for part in (objective.value(20.0, end), *objective.expand(20.0, end)):
        assert np.isfinite(part).all()


def test_the_goal_is_the_best_end_whatever_the_length() -> None:
    np.testing.assert_array_equal(HORIZON.kink, GOAL)
    at_goal = HORIZON.value(45.0, GOAL)
    assert at_goal < 1e-8
    for angle in np.linspace(0.0, 6.0, 7):
        off = np.array([np.cos(angle), np.sin(angle)])
        assert HORIZON.value(3.0, GOAL + 1e-6 * off) > at_goal


def test_a_detour_costs_and_so_does_an_end_far_from_the_goal() -> None:
    end = np.array([30.0, 30.0])
    assert HORIZON.value(45.0, end) > HORIZON.value(40.0, end)
    assert HORIZON.value(40.0, end) > HORIZON.value(40.0, end + 1.0)


def test_the_length_objective_is_smooth_and_looks_at_nothing_else() -> None:
    objective = LengthObjective()
    assert objective.kink is None
    assert objective.value(12.0, GOAL) == objective.value(12.0, START) == 12.0
