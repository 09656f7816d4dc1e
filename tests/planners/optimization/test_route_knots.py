"""Guesses along turns: knots on the route, segments within the limits, fewer where few are left."""

from itertools import pairwise

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization import along_route
from planners.optimization.route_knots import turn_aligned

ROW = Obstacles.discs([[4.0 * k, (-1.0) ** k] for k in range(1, 12)], np.full(11, 1.8))
"""Discs on alternating sides of the x-axis, which they overlap by 0.8 m."""


def slalom() -> Array:
    """The shortest route (m, 2) between the discs."""
    path = shortest_path(Field(name="row", obstacles=ROW, start=(0.0, 0.0), goal=(48.0, 0.0)))
    assert path is not None
    return path.points(0.25)


def state_on(points: Array) -> transition.State:
    """A state at a route's start that heads along it."""
    ahead = points[1] - points[0]
    return transition.State(points[0], 5.0 * ahead / np.linalg.norm(ahead))


def guesses(state: transition.State, points: Array, segments: int = 40) -> list[Array]:
    return list(turn_aligned(state, points, ROW, PAPER_LIMITS, segments))


def test_chains_lead_from_the_state_along_the_route_to_its_end() -> None:
    points = slalom()
    state = state_on(points)
    for chain in guesses(state, points):
        np.testing.assert_array_equal(chain[0, 0], state.position)
        np.testing.assert_array_equal(chain[0, 2], state.derivative)
        np.testing.assert_array_equal(chain[:-1, 1], chain[1:, 0])
        np.testing.assert_array_equal(chain[:-1, 3], chain[1:, 2])
        np.testing.assert_allclose(chain[-1, 1], points[-1], atol=1e-12)
        off = np.linalg.norm(chain[1:, 1, None] - points, axis=2).min(axis=1)
        assert off.max() < 0.2
        assert (length(chain) > 0.95 * PAPER_LIMITS.shortest).all()
        assert (length(chain) < 1.05 * PAPER_LIMITS.longest).all()


def test_they_pass_discs_that_evenly_spaced_knots_cut() -> None:
    points = slalom()
    state = state_on(points)
    chain = guesses(state, points)[0]
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    even = along_route(state, points, len(chain), way)
    assert ROW.clearance(chain).min() > -0.1
    assert ROW.clearance(chain).min() > ROW.clearance(even).min() + 0.05


def test_they_keep_to_the_number_of_segments_left() -> None:
    points = slalom()
    free = len(guesses(state_on(points), points)[0])
    for most in (free - 1, free + 5):
        assert all(len(chain) <= most for chain in guesses(state_on(points), points, most))
    assert guesses(state_on(points), points, 3) == []  # 48 m


def test_a_heading_into_a_disc_gets_a_first_knot_beside_the_route() -> None:
    disc = Obstacles.discs([[1.9, 0.0]], [1.5])
    path = shortest_path(Field(name="disc", obstacles=disc, start=(0.0, 0.0), goal=(30.0, 0.1)))
    assert path is not None
    state = transition.State(np.zeros(2), np.array([5.0, 0.0]))
    found = list(turn_aligned(state, path.points(0.25), disc, PAPER_LIMITS, 40))
    assert len(found) > 1
    depth = [-disc.clearance(chain[:1]).min() for chain in found]
    assert min(depth[1:]) < 0.5 * depth[0]


def test_a_route_shorter_than_a_segment_has_none() -> None:
    points = slalom()[:10]
    assert guesses(state_on(points), points) == []


@pytest.mark.parametrize("segments", [1, 2])
def test_a_straight_route_needs_few_segments(segments: int) -> None:
    points = np.column_stack([np.linspace(0.0, 14.0 * segments, 100), np.zeros(100)])
    open_field = Obstacles.discs([], [])
    chain = next(turn_aligned(state_on(points), points, open_field, PAPER_LIMITS, 40))
    assert len(chain) == segments
    np.testing.assert_allclose(chain[:, 1, 1], 0.0, atol=1e-12)


BLOCKS = Obstacles.boxes(
    [[8.0 * k - 2.0, -9.0 if k % 2 else -1.0] for k in range(1, 6)],
    [[8.0 * k + 2.0, 1.0 if k % 2 else 9.0] for k in range(1, 6)],
)
"""Rectangles on alternating sides of the x-axis, which they overlap by a metre."""


def around_blocks(radius: float) -> Array:
    """The shortest route between the rectangles, which passes by their corners."""
    corners = [[0.0, 0.0]]
    for k in range(1, 6):
        y = (1.0 + radius) * (1.0 if k % 2 else -1.0)
        corners += [[8.0 * k - 2.0 - radius, y], [8.0 * k + 2.0 + radius, y]]
    corners.append([48.0, 0.0])
    way = [np.linspace(a, b, 20) for a, b in pairwise(corners)]
    return np.concatenate([way[0], *(part[1:] for part in way[1:])])


@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_they_follow_the_corners_of_blocks(radius: float) -> None:
    points, blocks = around_blocks(radius), BLOCKS.grown(np.full(5, radius))
    state = state_on(points)
    chains = list(turn_aligned(state, points, blocks, PAPER_LIMITS, 40))
    way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    even = along_route(state, points, len(chains[0]), way)
    clear = blocks.clearance(chains[0]).min()
    assert clear > -0.4
    assert clear > blocks.clearance(even).min()


def test_a_thin_wall_is_as_deep_as_the_way_round_it() -> None:
    """A chain straight through it is no cheaper than one round its end, however thin it is."""
    wall = Obstacles.capsules([[[10.0, -8.0], [10.0, 8.0]]], 0.01)
    points = np.array([[0.0, 0.0], [10.0, 8.1], [20.0, 0.0]])
    way = [np.linspace(a, b, 40) for a, b in pairwise(points)]
    route = np.concatenate([way[0], way[1][1:]])
    for chain in turn_aligned(state_on(route), route, wall, PAPER_LIMITS, 40):
        middle = evaluate(chain, np.linspace(0.0, 1.0, 201)).reshape(-1, 2)
        assert np.abs(middle[np.abs(middle[:, 0] - 10.0).argmin(), 1]) > 7.0
