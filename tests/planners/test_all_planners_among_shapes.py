"""Every planner of the registry flies among blocks, walls, slivers and discs."""

import numpy as np
import pytest

from ferguson_gym.curves import evaluate
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from planners.contract import check_planner
from planners.interface import Status, initial_state
from planners.reachability import unreachable_plan
from planners.registry import PLANNERS
from tests.support.mixed_fields import mixed_field
from tests.support.quick_planners import quick

LONGEST = {"rrt": 0.5, "voronoi": 0.05, "multi-start": 0.01, "pursuit": 0.005}
"""Gaps to the shortest path above 0.2 %, which come from the routes."""

MAY_FAIL = {("single-start", 0), ("pso", 0)}
"""Caught in a pocket, as among discs, and without a route from a quarter of the usual budget."""


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("planner", PLANNERS)
def test_every_planner_flies_among_shapes(planner: str, seed: int) -> None:
    field = mixed_field(seed, 40)
    plan = quick(planner).plan(field, initial_state(field), 3)
    assert plan.success or (planner, seed) in MAY_FAIL
    assert is_feasible(plan.control, field).all()
    if plan.success:
        points = evaluate(plan.control, np.linspace(0.0, 1.0, 200))
        assert field.obstacles.signed_distance(points).min() >= -field.limits.tolerance
        exact = exact_length(field)
        assert exact is not None
        assert plan.path is not None
        assert -1e-6 <= plan.path.length / exact - 1.0 <= LONGEST.get(planner, 0.002)


@pytest.mark.parametrize("planner", ["guided", "pursuit", "multi-start", "shortest", "astar"])
def test_planners_keep_their_contract_among_shapes(planner: str) -> None:
    check_planner(quick(planner), mixed_field(2, 40))


def test_closed_walls_leave_no_way() -> None:
    corners = 5.0 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    walls = Obstacles.capsules(np.stack([corners, np.roll(corners, 1, axis=0)], axis=1), 0.01)
    plan = unreachable_plan(Field(name="room", obstacles=walls))
    assert plan is not None
    assert plan.status is Status.NO_WAY
    assert unreachable_plan(mixed_field(0)) is None
