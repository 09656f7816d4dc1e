"""Discs on Latin hypercubes, the paper's recipe, drawn as compiled code for many fields at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_without_lock
from ferguson_gym.world.recipes.mersenne_twister import LANES, WORDS, Words, first_doubles, seed

DESIGNS = 5
"""Latin hypercubes that are drawn, of which the best one is kept."""
_PER_DISC = 4 * DESIGNS + 1
"""Uniform numbers that a disc takes: in each design a rank and a jitter for both coordinates, and
the radius."""
Integers = NDArray[np.int64]


def latin_hypercube(stream: np.random.RandomState, points: int) -> Array:
    """A design (points, 2) in the unit square, as MATLAB's `lhsdesign(points, 2)` draws it.

    Its defaults: smoothing on, criterion maximin, 5 designs of which the one with the
    largest least distance between points is kept (the first wins a tie).
    """
    # MATLAB fills matrices by columns; a design takes one matrix for ranks, one for jitter
    best = np.empty((points, 2, LANES))
    draws = _in_first_lane(stream, 4 * DESIGNS * points)
    _maximin(draws.reshape((DESIGNS, 2, 2, points, LANES)), best)
    return best[..., 0].copy()


def scattered_discs(
    stream: np.random.RandomState, designs: tuple[int, ...], smallest: float, largest: float
) -> Array:
    """Discs (n, 3) of one field, x, y and radius [m]: Latin hypercubes on [5, 95]^2.

    Args:
        stream: randomness.
        designs: points of each hypercube.
        smallest: least radius [m].
        largest: greatest radius [m].
    """
    number = sum(designs)
    discs = np.empty((number, 3, LANES))
    draws = _in_first_lane(stream, _PER_DISC * number)
    _discs(draws, np.array(designs, np.int64), smallest, largest, discs)
    return discs[..., 0].copy()


def _in_first_lane(stream: np.random.RandomState, number: int) -> Array:
    draws = np.zeros((number, LANES))
    draws[:, 0] = stream.random_sample(number)
    return draws


@compiled
def _maximin(draws: Array, best: Array) -> None:
    """Keep the best of several designs, for LANES fields side by side.

    Args:
        draws: (designs, 2, columns, points, LANES) uniform numbers, for ranks and for jitter.
        best: (points, columns, LANES) in the unit square, filled.
    """
    designs, _, columns, points, _ = draws.shape
    design, ranks = np.empty((points, columns, LANES)), np.empty((points, LANES))
    spread, least = np.full(LANES, -1.0), np.empty(LANES)
    for k in range(designs):
        for c in range(columns):
            ranks[:] = 1.0
            for j in range(points):
                for i in range(points):
                    for lane in range(LANES):
                        ranks[i, lane] += draws[k, 0, c, j, lane] < draws[k, 0, c, i, lane]
            for i in range(points):
                for lane in range(LANES):
                    rank = ranks[i, lane]
                    design[i, c, lane] = (rank - draws[k, 1, c, i, lane]) / points
        least[:] = np.inf
        for i in range(points):
            for j in range(i):
                for lane in range(LANES):
                    square = 0.0
                    for c in range(columns):
                        square += (design[i, c, lane] - design[j, c, lane]) ** 2
                    least[lane] = min(least[lane], square)
        for lane in range(LANES):
            if least[lane] > spread[lane]:
                best[:, :, lane], spread[lane] = design[:, :, lane], least[lane]


@compiled
def _discs(draws: Array, designs: Integers, smallest: float, largest: float, discs: Array) -> None:
    """Discs of LANES fields side by side.

    Args:
        draws: (_PER_DISC n, LANES) uniform numbers.
        designs: points of each Latin hypercube.
        smallest: least radius [m].
        largest: greatest radius [m].
        discs: (n, 3, LANES) x, y and radius [m], filled.
    """
    row = first = 0
    for points in designs:
        rows = 4 * DESIGNS * points
        block = draws[row : row + rows].reshape((DESIGNS, 2, 2, points, LANES))
        _maximin(block, discs[first : first + points, :2])
        row, first = row + rows, first + points
    for i in range(first):
        for lane in range(LANES):
            discs[i, 0, lane] = 90.0 * discs[i, 0, lane] + 5.0
            discs[i, 1, lane] = 90.0 * discs[i, 1, lane] + 5.0
            discs[i, 2, lane] = smallest + (largest - smallest) * draws[row + i, lane]


@compiled_without_lock
def scatter(
    keys: Words, designs: Integers, smallest: float, largest: float, slots: Integers, discs: Array
) -> None:
    """Draw the discs of many fields, each from the stream `RandomState(key)`.

    Args:
        keys: (fields, numbers) of the streams.
        designs: points of each hypercube, together n.
        smallest: least radius [m].
        largest: greatest radius [m].
        slots: (fields,) where each is written.
        discs: (all slots, 3, n or more), filled with x, y and radius [m].
    """
    number = designs.sum()
    own = np.empty((LANES, keys.shape[1]), np.uint32)
    state, draws = np.empty((WORDS, LANES), np.uint32), np.empty((_PER_DISC * number, LANES))
    drawn = np.empty((number, 3, LANES))
    for begin in range(0, len(keys), LANES):
        count = min(LANES, len(keys) - begin)
        for lane in range(LANES):
            own[lane] = keys[begin + min(lane, count - 1)]
        seed(state, own)
        first_doubles(state, draws)
        _discs(draws, designs, smallest, largest, drawn)
        for lane in range(count):
            slot = slots[begin + lane]
            for d in range(3):
                for i in range(number):
                    discs[slot, d, i] = drawn[i, d, lane]
