"""Lines that cross cores, against sampling, and the way out of them."""

import numpy as np
import pytest

from ferguson_gym.curves.core_crossings import crosses, line_exit
from ferguson_gym.world.obstacles import Obstacles

BOX = np.ascontiguousarray(Obstacles.boxes([[6.0, -3.0]], [[8.0, 1.0]]).points.T)


@pytest.mark.parametrize(
    ("height", "left", "depth"), [(0.5, True, 0.5), (-2.5, False, 0.5), (2.0, True, -1.0)]
)
def test_a_line_moves_out_on_the_side_that_is_nearer(
    height: float, left: bool, depth: float
) -> None:
    out = line_exit(0.0, height, 2.0, 0.0, BOX, 0, 4)
    assert out.left == left
    assert out.depth == pytest.approx(depth)
    assert BOX[1, out.corner] == (1.0 if left else -3.0)


@pytest.mark.parametrize("seed", range(20))
def test_a_line_that_has_moved_out_touches_the_corner_alone(seed: int) -> None:
    stream = np.random.default_rng(seed)
    angle = np.sort(stream.uniform(0.0, 2.0 * np.pi, int(stream.integers(3, 9))))
    corners = np.ascontiguousarray(np.stack([np.cos(angle), 0.5 * np.sin(angle)]))
    direction, point = stream.normal(size=2), corners.mean(axis=1)
    out = line_exit(*point, *direction, corners, 0, corners.shape[1])
    across = np.array([-direction[1], direction[0]]) / np.linalg.norm(direction)
    across = across if out.left else -across
    beyond = across @ (corners - (point + out.depth * across)[:, None])
    assert out.depth > 0.0
    assert beyond.max() == pytest.approx(0.0, abs=1e-12)
    assert beyond.argmax() == out.corner
    # the other side is farther
    assert -(across @ (corners - point[:, None])).min() >= out.depth - 1e-12


@pytest.mark.parametrize("number", [2, 3, 7])
def test_lines_cross_where_sampled_points_lie_inside(number: int) -> None:
    stream, both = np.random.default_rng(number), np.zeros(2, np.int64)
    angle = np.linspace(0.0, 2.0 * np.pi, number, endpoint=False)
    corners = np.ascontiguousarray(np.stack([np.cos(angle), 0.4 * np.sin(angle)]))
    hull = Obstacles(corners.T, np.array([1e-9]), np.array([0, number]))
    for _ in range(300):
        start, end = stream.uniform(-1.5, 1.5, (2, 2))
        points = start + np.linspace(0.0, 1.0, 4001)[:, None] * (end - start)
        least = float(hull.signed_distance(points).min())
        near_end = np.linalg.norm(points - np.array([[[1.0, 0.0]], [[-1.0, 0.0]]]), axis=-1).min()
        if abs(least) < 1e-3 and (number > 2 or near_end < 5e-3):
            continue
        expected = least < 1e-3
        assert crosses(*start, *(end - start), corners, 0, number) == expected
        both[int(expected)] += 1
    assert both.min() > 20
