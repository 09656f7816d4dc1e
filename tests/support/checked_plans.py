"""Plans of quick planners, and the check that one can be flown."""

from functools import cache

import numpy as np

from ferguson_gym.curves.splines import derivative, evaluate
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from planners.interface import Plan, initial_state
from tests.support.quick_planners import quick


def assert_may_be_flown(plan: Plan, field: Field) -> None:
    """Checked without the project's certificates: densely sampled, and by definition."""
    control = plan.control
    t = np.linspace(0.0, 1.0, 2001)
    points, slopes = evaluate(control, t), derivative(control, t)
    np.testing.assert_array_equal(control[0, 0], field.start)
    np.testing.assert_array_equal(control[0, 2], field.departure)
    np.testing.assert_array_equal(control[1:, (0, 2)], control[:-1, (1, 3)])
    np.testing.assert_array_equal(control[-1, 1], field.goal)
    if len(field.obstacles):
        assert field.obstacles.signed_distance(points).min() >= -1e-5
    speed = np.linalg.norm(slopes, axis=-1)
    assert speed.min() >= 0.1 - 1e-5
    assert ((points >= field.bounds[0] - 1e-5) & (points <= field.bounds[1] + 1e-5)).all()
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=-1).sum(axis=1)
    assert lengths.min() >= 3.0 - 1e-4
    assert lengths.max() <= 15.0 + 1e-5
    assert is_feasible(control, field).all()


@cache
def planned(planner: str, name: str) -> Plan:
    field = get_field(name)
    return quick(planner).plan(field, initial_state(field), 3)
