"""What IPOPT refuses; `tests/agents/benchmarks` solves windows with it."""

import pytest

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import initial_state
from planners.optimization.reference.ipopt import Ipopt
from planners.optimization.window import WindowSettings, horizon_window


def test_obstacles_of_other_shapes_are_refused() -> None:
    field = Field(name="house", obstacles=Obstacles.boxes([[10.0, 10.0]], [[18.0, 18.0]]))
    window = horizon_window(field, initial_state(field), WindowSettings(), 3)
    problem = window.sampled()
    with pytest.raises(
        TypeError, match="IPOPT needs discs, since its distances are symbolic; ByEx"
    ):
        Ipopt().solve(problem, problem.bounds[0])
