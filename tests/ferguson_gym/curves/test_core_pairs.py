"""Gaps between cores, against what the definition by directions gives."""

import numpy as np
import pytest

from ferguson_gym.curves.core_pairs import boundaries_apart, cores_gap
from ferguson_gym.world.cores.hulls import hull

TURNS = np.linspace(0.0, 2.0 * np.pi, 7201)[:-1]
UNITS = np.stack([np.cos(TURNS), np.sin(TURNS)])
PLANE = (0, 1)
SQUARE = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]


def columns(core: object) -> np.ndarray:
    return np.ascontiguousarray(np.array(core, dtype=float).T)


def gap(one: object, other: object) -> float:
    a, b = columns(one), columns(other)
    axes = tuple(range(len(a)))
    found = cores_gap(a, 0, a.shape[1], b, 0, b.shape[1], axes)
    assert cores_gap(b, 0, b.shape[1], a, 0, a.shape[1], axes) == pytest.approx(found, abs=1e-12)
    return float(found)


@pytest.mark.parametrize("seed", range(200))
def test_the_gap_is_that_of_the_best_direction(seed: int) -> None:
    stream = np.random.default_rng(seed)
    sizes, shifts = stream.integers(1, 7, 2), stream.uniform(-1.5, 1.5, (2, 2))
    one, other = (
        hull(stream.uniform(-1.0, 1.0, (size, 2)) + shift)[0]
        for size, shift in zip(sizes, shifts, strict=True)
    )
    # of all directions, the one in which the other core lies farthest ahead
    ahead = (other @ UNITS).min(axis=0) - (one @ UNITS).max(axis=0)
    found = gap(one, other)
    assert ahead.max() - 1e-12 <= found <= ahead.max() + 2e-3


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ([[2.0, 0.5], [4.0, 0.5], [4.0, 1.0]], 0.0),  # a side on a side
        ([[2.0, 2.0], [4.0, 5.0]], 0.0),  # a corner on a corner
        ([[3.0, 3.0]], np.sqrt(2.0)),
        ([[1.0, 1.5]], -0.5),
        ([[0.5, 1.0], [1.5, 1.0]], -1.0),  # within
        ([[-5.0, 1.0], [5.0, 1.0]], -1.0),  # across
        ([[1.5, -3.0], [5.0, -3.0], [5.0, 3.0], [1.5, 3.0]], -0.5),
    ],
)
def test_known_gaps_from_a_square(other: list[list[float]], expected: float) -> None:
    assert gap(SQUARE, other) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, 0.1])
def test_lines_that_are_almost_parallel_are_as_far_apart_as_their_ends(angle: float) -> None:
    one = columns([[0.0, 0.0], [100.0, 0.0]])
    other = columns([[10.0, 1.0], [110.0, 1.0 + 100.0 * angle]])
    assert boundaries_apart(one, 0, 2, other, 0, 2, PLANE) == pytest.approx(1.0, rel=1e-12)
    # past each other's ends
    crossed = columns([[10.0, -50.0 * angle], [110.0, 50.0 * angle]])
    assert boundaries_apart(one, 0, 2, crossed, 0, 2, PLANE) <= 1e-9


def test_lines_in_space_pass_each_other() -> None:
    assert gap([[0, 0, 0], [2, 0, 0]], [[1, -1, 3], [1, 1, 3]]) == pytest.approx(3.0)
    assert gap([[0, 0, 0], [2, 0, 0]], [[5, 0, 4]]) == pytest.approx(5.0)
