"""Discs that touch without overlapping are found, whatever their sizes."""

import time

import numpy as np
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
