"""The exchange method: rows are added where certification finds a violation."""

import numpy as np
import pytest

from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.certification import TARGET_TOLERANCE
from planners.optimization.initial_guesses import straight_ahead
from planners.optimization.reference.exchange import ByExchange, broken_rows
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.window import WindowSettings, horizon_window


def test_exchange_closes_what_samples_miss() -> None:
    # a disc so small that it hides between the paper's samples of a straight flight
    disc = Obstacles.discs([[4.7, 4.7]], [0.08])
    field = Field(name="pin", obstacles=disc)
    window = horizon_window(field, transition.initial_state(field), WindowSettings(), 3)
    guess = straight_ahead(transition.initial_state(field), 3, PAPER_LIMITS)
    problem = window.sampled()
    sampled = problem.chain.control(Slsqp().solve(problem, problem.chain.unknowns(guess)).x)
    assert problem.c(problem.chain.unknowns(sampled)).min() >= -1e-5
    assert not is_feasible(sampled, field).all()
    (certified,) = ByExchange(Slsqp()).solve(window, [guess])
    assert certified.feasible
    assert certified.rounds > 1
    assert is_feasible(certified.control, field, tolerance=TARGET_TOLERANCE).all()
    assert certified.solution.objective <= float(problem.f(problem.chain.unknowns(sampled))) * 1.01


@pytest.mark.parametrize(
    ("segment", "kind"),
    [
        ([[0, 0], [9, 0], [9, 0], [9, 0]], None),
        ([[0, 0], [20, 0], [20, 0], [20, 0]], "LengthBounds"),
        ([[0, 0], [1, 0], [1, 0], [1, 0]], "LengthBounds"),
        ([[0, 0], [6, 6], [0, 0], [6, 6]], "SpeedAt"),
        ([[-9, 0], [-9, 6], [-12, 0], [12, 0]], "InsideAt"),
        ([[20, 50], [32, 50], [12, 0], [12, 0]], "ClearanceAt"),
    ],
)
def test_certification_names_the_row_that_is_broken(
    segment: list[list[float]], kind: str | None
) -> None:
    field = Field(name="disc", obstacles=Obstacles.discs([[26.0, 50.0]], [1.0]))
    rows = broken_rows(np.array([segment], dtype=float), field)
    assert [type(row).__name__ for row in rows] == ([] if kind is None else [kind])
    for row in rows:
        assert row.values(np.array([segment], dtype=float)).min() < -TARGET_TOLERANCE
