"""Whole paths by convex programs are certified chains to the goal."""

import numpy as np
import pytest

from ferguson_gym.world import is_feasible, transition
from ferguson_gym.world.field_names import get_field
from planners.whole_path.convex_fit import convex_fit
from planners.whole_path.exact import ShortestPathRouter


@pytest.mark.parametrize(
    "name",
    [
        "walls/train:0",
        # the shortest path's segments cut through walls, so that one of the later grains is needed
        "walls/validation:268",
        "walls/validation:278",
        "walls/validation:289",
    ],
)
def test_segments_are_certified_and_end_on_the_goal(name: str) -> None:
    field = get_field(name)
    vehicle = transition.initial_state(field)
    route = ShortestPathRouter().route(field, vehicle, 0)
    assert route is not None
    chain = convex_fit(route.points, field, vehicle)
    assert chain is not None
    assert is_feasible(chain, field).all()
    np.testing.assert_array_equal(chain[-1, 1], field.goal)
    np.testing.assert_array_equal(chain[1:, 0], chain[:-1, 1])
    np.testing.assert_array_equal(chain[1:, 2], chain[:-1, 3])
