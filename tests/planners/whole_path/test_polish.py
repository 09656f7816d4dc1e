"""A whole flight optimised at once."""

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field_names import get_field
from planners.interface import initial_state
from planners.optimization.certification import TARGET_TOLERANCE
from planners.registry import make
from planners.whole_path.polish import polish
from tests.support.quick_planners import quick


@pytest.mark.parametrize("planner", ["multi-start", "guided", "shortest", "rrt"])
def test_a_polished_flight_is_no_longer_and_flies(planner: str) -> None:
    field = get_field("standard/train:1")
    plan = quick(planner).plan(field, initial_state(field), 0)
    assert plan.success
    chain = polish(plan.control, field)
    exact = exact_length(field)
    assert exact is not None
    assert exact * (1.0 - 1e-6) <= length(chain).sum() <= length(plan.control).sum()
    assert is_feasible(chain, field).all()
    np.testing.assert_array_equal(chain[0, (0, 2)], [field.start, field.departure])
    np.testing.assert_array_equal(chain[-1, 1], field.goal)
    np.testing.assert_array_equal(chain[1:, (0, 2)], chain[:-1, (1, 3)])


def test_a_horizon_leaves_something_to_polish() -> None:
    """The paper's objective pays for directness; the whole flight's length does not."""
    field = get_field("paper:1")
    flown = make("multi-start").plan(field, initial_state(field), 0).control
    chain = polish(flown, field)
    assert length(chain).sum() < 0.9999 * length(flown).sum()
    assert is_feasible(chain, field, tolerance=TARGET_TOLERANCE).all()


def test_invalid_flights_are_refused() -> None:
    field = get_field("standard/train:1")
    flown = make("guided").plan(field, initial_state(field), 0).control
    with pytest.raises(ValueError, match=r"not on the goal"):
        polish(flown[:-1], field)
    with pytest.raises(ValueError, match=r"got \(4, 2\)"):
        polish(flown[-1], field)
