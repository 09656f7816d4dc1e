"""States that nobody flies into, but may ask planners about: they give up and raise nothing."""

import numpy as np
import pytest

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State as Vehicle
from planners.contract import _check_plan
from planners.interface import State, Status
from tests.support.quick_planners import quick

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
CLOSE = Field(
    name="close",
    obstacles=Obstacles.discs([], []),
    goal=np.array([1e-7, 0.0]),
    start_derivative=np.array([5.0, 0.0]),
)


@pytest.mark.parametrize("name", ["single-start", "multi-start", "guided", "pursuit", "shortest"])
def test_a_vehicle_that_stands_still_goes_nowhere(name: str) -> None:
    still = State(Vehicle(np.zeros(2), np.zeros(2)))
    plan = quick(name).plan(OPEN, still, seed=0)
    assert plan.status in (Status.STUCK, Status.NOT_FITTED)
    assert len(plan.control) == 0


def test_a_search_whose_squares_vanish_ends_honestly() -> None:
    # numbers so small that their squares are none led the search to NaN
    lost = State(Vehicle(np.array([-10.0, -10.0]), np.array([1.0, 8.3e-192])))
    plan = quick("single-start").plan(CLOSE, lost, seed=0)
    assert np.isfinite(plan.control).all()
    _check_plan(plan, CLOSE, lost)
