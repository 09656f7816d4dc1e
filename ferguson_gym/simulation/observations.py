"""What a pilot sees: numbers in [-1, 1], in a frame that is turned with the vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.world.actions import heading, share_of_steepest

Single: TypeAlias = NDArray[np.float32]
Observation: TypeAlias = dict[str, Single]

KINDS = ("discs", "rays", "both")
"""What obstacles are seen as: the nearest discs, ranges along rays (a lidar), or both."""


class Layout(NamedTuple):
    """Where a flat observation has its entries; in the order of `gymnasium.spaces.flatten`."""

    nearest: int
    """K discs that are seen; 0 for rays alone."""
    ways: Single
    """Directions (2, R) in the vehicle's frame of the ranges that are seen; (2, 0) for discs
    alone."""
    focus: float
    """Discs are seen that are nearest to the point this far ahead [m]."""
    sight: float
    """How far is seen, and what lengths are parts of [m]."""

    def entries(self) -> dict[str, int]:
        """Number of values of each entry, in order."""
        sizes = {"goal": 3, "mask": self.nearest, "obstacles": 4 * self.nearest}
        sizes |= {"rays": self.ways.shape[1], "vehicle": 6}
        return {key: size for key, size in sizes.items() if size}


def rays_around(number: int) -> Single:
    """Directions (2, number) all around, the first one forward, then to the left."""
    angles = 2.0 * np.pi * np.arange(number) / max(number, 1)
    return np.array([np.cos(angles), np.sin(angles)], np.float32)


def entries_of(flat: Single, sizes: Mapping[str, int], *number: int) -> Observation:
    """Views of the entries of N observations, each (N, size), which lie one after the other.

    Args:
        flat: as `look` fills it.
        sizes: number of values of each entry, in order.
        number: N, or nothing for a single observation without that axis.
    """
    entries, start = {}, 0
    for key, size in sizes.items():
        stop = start + size * math.prod(number)
        entries[key] = flat[start:stop].reshape(*number, size)
        start = stop
    return entries


@compiled
def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)


@compiled_in_place
def write_observation(
    seen: Single,
    i: int,
    number: int,
    layout: Layout,
    position: Array,
    derivative: Array,
    left: float,
    goal: Array,
    bounds: Array,
    columns: Array,
    radii: Array,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Fill in one of N observations; the environment's docstring says with what.

    Args:
        seen: (N n,) where it is written: of each entry the values of all N, then the next entry.
        i: which of them it is.
        number: N.
        layout: of each.
        position: (2,) [m].
        derivative: (2,) [m per unit t].
        left: segments left, part of all.
        goal: (2,) [m].
        bounds: (2, 2) [m].
        columns: (2, M) centres of the discs.
        radii: (M,); rows of padding have a radius of minus infinity.
        work: scratch (2, M).
        found: scratch (M,).
    """
    turn = heading(derivative[0], derivative[1])
    cos, sin = turn.real, turn.imag
    x, y = goal[0] - position[0], goal[1] - position[1]
    distance = np.sqrt(x * x + y * y)
    diagonal = np.sqrt((bounds[1, 0] - bounds[0, 0]) ** 2 + (bounds[1, 1] - bounds[0, 1]) ** 2)
    row = seen[3 * i : 3 * i + 3]
    row[0] = _clipped(distance / diagonal)
    row[1] = _clipped((cos * x + sin * y) / distance) if distance > 0.0 else 1.0
    row[2] = _clipped((cos * y - sin * x) / distance) if distance > 0.0 else 0.0

    rays, nearest = layout.ways.shape[1], layout.nearest
    rest, view = seen[3 * number :], layout.sight
    if nearest > 0:
        mask, rest = rest[nearest * i : nearest * (i + 1)], rest[nearest * number :]
        rows = rest[4 * nearest * i : 4 * nearest * (i + 1)]
        _nearest(mask, rows, layout.focus, view, position, cos, sin, columns, radii, work, found)
        rest = rest[4 * nearest * number :]
    if rays > 0:
        ranges = rest[rays * i : rays * (i + 1)]
        _ranges(ranges, layout.ways, view, position, turn, bounds, columns, radii, work, found)
        rest = rest[rays * number :]

    row = rest[6 * i : 6 * i + 6]
    for d in range(2):
        low, high = bounds[0, d], bounds[1, d]
        row[d] = _clipped(2.0 * (position[d] - low) / (high - low) - 1.0)
    row[2] = _clipped(cos)
    row[3] = _clipped(sin)
    speed = np.sqrt(derivative[0] ** 2 + derivative[1] ** 2)
    row[4] = _clipped(share_of_steepest(speed))
    row[5] = left


@compiled_in_place
def _within(
    view: float,
    x: float,
    y: float,
    columns: Array,
    radii: Array,
    spare: Array,
    found: NDArray[np.int64],
) -> int:
    """Fill `found` with the discs whose surface is within view of a point; their number."""
    for k in range(len(radii)):  # without branches or roots: it becomes vector instructions
        along, across = columns[0, k] - x, columns[1, k] - y
        wide = radii[k] + view
        wide = wide if wide > 0.0 else 0.0
        spare[k] = wide * wide - (along * along + across * across)
    number = 0
    for k in range(len(radii)):  # without a branch, which no processor could predict
        found[number] = k
        number += spare[k] > 0.0
    return number


@compiled
def _nearest(
    mask: Single,
    rows: Single,
    focus: float,
    view: float,
    position: Array,
    cos: float,
    sin: float,
    columns: Array,
    radii: Array,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Fill mask (K,) and obstacles (4 K,): discs within view, nearest to the focus first."""
    near, share = work[1], 1.0 / view
    x, y = position[0] + focus * cos, position[1] + focus * sin
    seen = _within(view, x, y, columns, radii, work[0], found)
    for m in range(seen):
        k = found[m]
        along, across = columns[0, k] - x, columns[1, k] - y
        near[m] = np.sqrt(along * along + across * across) - radii[k]
    for j in range(len(mask)):
        mask[j] = 0.0
    for j in range(len(rows)):
        rows[j] = 0.0
    for m in range(seen):
        j = 0
        for other in range(seen):
            j += near[other] < near[m]
        while j < len(mask) and mask[j] > 0.0:  # taken by one at the same distance
            j += 1
        if j < len(mask):
            k = found[m]
            x, y = columns[0, k] - position[0], columns[1, k] - position[1]
            rows[4 * j] = _clipped((cos * x + sin * y) * share)
            rows[4 * j + 1] = _clipped((cos * y - sin * x) * share)
            rows[4 * j + 2] = _clipped(radii[k] * share)
            rows[4 * j + 3] = _clipped((np.sqrt(x * x + y * y) - radii[k]) * share)
            mask[j] = 1.0


@compiled
def _ranges(
    ranges: Single,
    ways: Single,
    far: float,
    position: Array,
    turn: complex,
    bounds: Array,
    columns: Array,
    radii: Array,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Fill ranges (R,) to the nearest disc or bound along ways (2, R) in the vehicle's frame.

    In single precision and without branches in the loops over rays: they become vector
    instructions, and the result is of single precision anyway.
    """
    cos, sin = np.float32(turn.real), np.float32(turn.imag)
    none, one = np.float32(0.0), np.float32(1.0)
    tiny = np.float32(1e-30)
    west, east = np.float32(bounds[0, 0] - position[0]), np.float32(bounds[1, 0] - position[0])
    south, north = np.float32(bounds[0, 1] - position[1]), np.float32(bounds[1, 1] - position[1])
    view = np.float32(far)
    for j in range(len(ranges)):
        x = cos * ways[0, j] - sin * ways[1, j]
        y = sin * ways[0, j] + cos * ways[1, j]
        x = x if abs(x) > tiny else tiny
        y = y if abs(y) > tiny else tiny
        along = (east if x > none else west) / x
        across = (north if y > none else south) / y
        reach = along if along < across else across
        reach = reach if reach < view else view
        ranges[j] = reach if reach > none else none
    for m in range(_within(far, position[0], position[1], columns, radii, work[0], found)):
        k = found[m]
        x, y = columns[0, k] - position[0], columns[1, k] - position[1]
        ahead = np.float32(turn.real * x + turn.imag * y)
        left = np.float32(turn.real * y - turn.imag * x)
        # (r - a)(r + a), not r^2 - a^2, which would have no digits left for a wall of a disc
        radius = np.float32(radii[k])
        for j in range(len(ranges)):
            along = ways[0, j] * ahead + ways[1, j] * left
            across = ways[0, j] * left - ways[1, j] * ahead
            half2 = (radius - across) * (radius + across)
            reach = along - np.sqrt(half2 if half2 > none else none)
            reach = reach if reach > none else none
            hit = half2 > none and along > none and reach < ranges[j]
            ranges[j] = reach if hit else ranges[j]
    for j in range(len(ranges)):
        ranges[j] *= one / view
