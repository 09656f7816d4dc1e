"""Obstacles that touch without overlapping are found, whatever their shapes and sizes."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ferguson_gym.world import Field, Obstacles, get_field
from ferguson_gym.world.touching import touching_pairs


def field_of(discs: Obstacles) -> Field:
    bounds = np.array([-1e4, 1e4])
    return Field(name="discs", obstacles=discs, start=[-9e3, 0.0], goal=[9e3, 0.0], bounds=bounds)


def test_only_discs_that_touch_without_overlapping_are_found() -> None:
    centers = [[0.0, 0.0], [3.0, 0.0], [0.0, 2.9], [-3.1, 0.0], [0.0, 0.5], [0.0, -60.0]]
    discs = Obstacles.discs(centers, [1.0, 2.0, 2.0, 2.0, 0.5, 59.0])
    # the fifth touches the first from within, which leaves no gap
    assert touching_pairs(field_of(discs)).tolist() == [[0, 1], [0, 5]]
    nearly = Obstacles.discs([[0.0, 0.0], [2.0 + 0.9e-5, 0.0], [4.0 + 2e-5, 0.0]], [1.0, 1.0, 1.0])
    assert touching_pairs(field_of(nearly)).tolist() == [[0, 1]]
    for none in (Obstacles.discs(np.empty((0, 2)), []), Obstacles.discs([[0.0, 0.0]], [1.0])):
        assert touching_pairs(field_of(none)).shape == (0, 2)
    assert len(touching_pairs(get_field("dense/train:0"))) == 0


@given(st.integers(0, 2**32 - 1))
def test_all_pairs_are_found(seed: int) -> None:
    draw = np.random.default_rng(seed)
    number = 40
    centers = draw.integers(0, 30, (number, 2)).astype(float)
    radii = 2.0 ** draw.integers(-2, 5, number)
    offset = centers[:, None] - centers
    gaps = np.linalg.norm(offset, axis=-1) - radii[:, None] - radii
    expected = np.argwhere(np.triu(np.abs(gaps) <= 1e-5, 1))
    found = touching_pairs(field_of(Obstacles.discs(centers, radii)))
    assert sorted(found.tolist()) == expected.tolist()


def test_ten_thousand_cylinders_take_no_time() -> None:
    grid = np.stack(np.meshgrid(np.arange(100), np.arange(100)), -1).reshape(-1, 2)
    field = field_of(Obstacles.discs(0.15 * grid, np.full(10_000, 0.075)))
    began = time.perf_counter()
    assert len(touching_pairs(field)) == 2 * 99 * 100
    assert time.perf_counter() - began < 1.0  # 0.01 s on an idle machine


def test_shapes_that_touch_are_found() -> None:
    shapes = Obstacles.joined(
        [
            Obstacles.boxes(
                [[0.0, 0.0], [5.0, 1.0], [5.0, -4.0]], [[5.0, 5.0], [9.0, 2.0], [8.0, 0.0]]
            ),
            Obstacles.capsules([[[0.0, 7.0], [30.0, 7.0]]], 2.0),
            Obstacles.discs([[11.0, 1.5], [20.0, 8.0]], [2.0, 0.5]),
            Obstacles.boxes([[-4.0 + 2e-5, 0.0]], [[2e-5, 1.0]]),
        ]
    )
    # by a side, by a corner, below the wall, at the end of a block; the last two overlap others
    assert sorted(touching_pairs(field_of(shapes)).tolist()) == [[0, 1], [0, 2], [0, 3], [1, 4]]


def test_pairs_between_which_further_obstacles_let_no_path_pass_are_left_out() -> None:
    halves = Obstacles.boxes([[0.0, 0.0], [4.0, 0.0]], [[4.0, 8.0], [9.0, 8.0]])

    def found(*more: Obstacles) -> list[list[int]]:
        return touching_pairs(field_of(Obstacles.joined([halves, *more]))).tolist()

    assert found() == [[0, 1]]
    assert found(Obstacles.boxes([[3.0, 0.0]], [[5.0, 8.0]])) == []
    assert found(Obstacles.discs([[4.0, 4.0]], [6.0])) == []
    # half of the side is open, or a wall lies beside it
    assert found(Obstacles.boxes([[3.0, 0.0]], [[5.0, 4.0]])) == [[0, 1]]
    assert [0, 1] in found(Obstacles.boxes([[4.0, -2.0]], [[9.0, 0.0]]))
    # two corners that meet, and what lies beyond them on one side
    corners = Obstacles.boxes([[20.0, 0.0], [24.0, 4.0]], [[24.0, 4.0], [28.0, 8.0]])
    assert [2, 3] in found(corners)
    beyond = Obstacles.boxes([[20.5, 3.5]], [[24.5, 8.0]])
    assert [2, 3] not in found(corners, beyond)


def test_sides_that_are_nearly_in_line_do_not_touch() -> None:
    """Two blocks of a street, turned: rounding once made their sides cross."""
    turn = np.array([[0.9334607, 0.3586798], [-0.3586798, 0.9334607]])
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    block, along = np.array([[0, 0], [6, 0], [6, 12], [0, 12]]), np.array([0.0, 19.0])
    corners = [(block + k * along) @ turn + [70.0, 30.0] for k in range(40)]
    field = field_of(Obstacles.polygons(corners))
    assert touching_pairs(field).tolist() == []


@pytest.mark.parametrize("seed", range(5))
def test_all_pairs_of_shapes_are_found(seed: int) -> None:
    draw = np.random.default_rng(seed)
    low = draw.integers(0, 40, (40, 2)).astype(float)
    boxes = Obstacles.boxes(low, low + draw.integers(1, 8, (40, 2)), draw.integers(0, 3, 40))
    ends = draw.integers(0, 40, (20, 2, 2)).astype(float)
    ends[:, 1] = np.where(draw.integers(0, 2, (20, 1)), ends[:, 0] + [5.0, 0.0], ends[:, 0])
    every = Obstacles.joined([boxes, Obstacles.capsules(ends, draw.integers(1, 4, 20))])
    low, high = np.split(
        np.array([[c.min(axis=0), c.max(axis=0)] for c in cores(every)]), 2, axis=1
    )
    # sides along the axes: the gap is that of rectangles
    beyond = np.maximum(low[:, None, 0] - high[:, 0], low[:, 0] - high[:, None, 0])
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    apart = np.where(outside > 0.0, outside, beyond.max(axis=-1))
    # two lines do not overlap more than that they cross
    flat = np.array([(c.max(axis=0) == c.min(axis=0)).any() for c in cores(every)])
    apart = np.where(flat[:, None] & flat, np.maximum(apart, 0.0), apart)
    gaps = apart - every.radii[:, None] - every.radii
    expected = np.argwhere(np.triu(np.abs(gaps) <= 1e-5, 1)).tolist()
    found = touching_pairs(field_of(every)).tolist()
    # others let no path pass
    assert len(found) > 3
    assert all(pair in expected for pair in found)
    for i, j in [pair for pair in expected if pair not in found]:
        alone = every.only_these(np.array([i, j]))
        assert touching_pairs(field_of(alone)).tolist() == [[0, 1]]


def cores(obstacles: Obstacles) -> list[np.ndarray]:
    return [obstacles.core(k) for k in range(len(obstacles))]
