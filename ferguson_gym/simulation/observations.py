"""The observation: numbers in [-1, 1], in the body frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, has_core
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.simulation.observed_cores import (
    keep_within,
    nearest_outline_point,
    shorten_by_arc,
    shorten_by_core,
)
from ferguson_gym.world.actions import heading, share_of_steepest

FlatObservation: TypeAlias = NDArray[np.float32]
Observation: TypeAlias = dict[str, FlatObservation]

KINDS = ("discs", "rays", "both")
"""How obstacles are observed: as the nearest discs, as ranges along rays (a lidar), or as both."""


class Layout(NamedTuple):
    """What an observation consists of; entries in the order of `gymnasium.spaces.flatten`."""

    nearest: int
    """Rows K for the nearest discs; 0 for rays alone."""
    ray_directions: FlatObservation
    """Unit vectors (2, R) in the vehicle's frame; (2, 0) for discs alone."""
    focus: float
    """Discs are ordered by their distance from the point this far ahead [units of the field]."""
    max_range: float
    """Range of the observation, by which lengths are divided [units of the field]."""
    way: int = 0
    """Points N of the way ahead; 0 for none. `ferguson_gym.simulation.ways` writes them."""

    def entries(self) -> dict[str, int]:
        """Number of values of each entry, in order."""
        sizes = {"goal": 3, "mask": self.nearest, "obstacles": 4 * self.nearest}
        sizes |= {"rays": self.ray_directions.shape[1], "vehicle": 6}
        sizes |= {"way": 2 * self.way + 2 if self.way else 0}
        return {key: size for key, size in sizes.items() if size}


def rays_around(number: int) -> FlatObservation:
    """Unit vectors (2, number) at equal angles, the first one forward, then to the left."""
    angles = 2.0 * np.pi * np.arange(number) / max(number, 1)
    return np.array([np.cos(angles), np.sin(angles)], np.float32)


def entries_of(flat: FlatObservation, sizes: Mapping[str, int], *number: int) -> Observation:
    """Views (N, size) of the entries of N observations (N n,), by name.

    Without a number N, views (size,) of a single observation.
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
    observations: FlatObservation,
    i: int,
    number: int,
    layout: Layout,
    position: Array,
    derivative: Array,
    remaining: float,
    unit: float,
    goal: Array,
    bounds: Array,
    columns: Array,
    radii: Array,
    cores: Cores,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Write one of N observations, as specified in the environment's docstring.

    `observations` (N n,) hold for each entry the values of all N, then the next entry; `i` is the
    index of the one to write. `remaining` is the fraction of segments left, `unit` that of the
    field's limits [m]. The balls that bound the obstacles, discs themselves, have centres
    `columns` (2, M) and `radii` (M,), minus infinity for padding; `cores` are those of obstacles
    that are not all discs. Scratch: work (2, M), found (M,).
    """
    turn = heading(derivative[0], derivative[1])
    cos, sin = turn.real, turn.imag
    x, y = goal[0] - position[0], goal[1] - position[1]
    distance = np.sqrt(x * x + y * y)
    diagonal = np.sqrt((bounds[1, 0] - bounds[0, 0]) ** 2 + (bounds[1, 1] - bounds[0, 1]) ** 2)
    row = observations[3 * i : 3 * i + 3]
    row[0] = _clipped(distance / diagonal)
    row[1] = _clipped((cos * x + sin * y) / distance) if distance > 0.0 else 1.0
    row[2] = _clipped((cos * y - sin * x) / distance) if distance > 0.0 else 0.0

    rays, nearest = layout.ray_directions.shape[1], layout.nearest
    rest, view = observations[3 * number :], layout.max_range * unit
    if nearest > 0:
        mask, rest = rest[nearest * i : nearest * (i + 1)], rest[nearest * number :]
        rows = rest[4 * nearest * i : 4 * nearest * (i + 1)]
        _write_nearest(
            mask,
            rows,
            layout.focus * unit,
            view,
            position,
            cos,
            sin,
            columns,
            radii,
            cores,
            work,
            found,
        )
        rest = rest[4 * nearest * number :]
    if rays > 0:
        ranges = rest[rays * i : rays * (i + 1)]
        _write_ranges(
            ranges,
            layout.ray_directions,
            view,
            position,
            turn,
            bounds,
            columns,
            radii,
            cores,
            work,
            found,
        )
        rest = rest[rays * number :]

    row = rest[6 * i : 6 * i + 6]
    for d in range(2):
        low, high = bounds[0, d], bounds[1, d]
        row[d] = _clipped(2.0 * (position[d] - low) / (high - low) - 1.0)
    row[2] = _clipped(cos)
    row[3] = _clipped(sin)
    speed = np.sqrt(derivative[0] ** 2 + derivative[1] ** 2)
    row[4] = _clipped(share_of_steepest(speed / unit))
    row[5] = remaining


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
    """Fill `found` with the balls whose surface is within view of a point; return their number."""
    for k in range(len(radii)):  # no branches or roots, so that it becomes vector instructions
        along, across = columns[0, k] - x, columns[1, k] - y
        wide = radii[k] + view
        wide = wide if wide > 0.0 else 0.0
        spare[k] = wide * wide - (along * along + across * across)
    number = 0
    for k in range(len(radii)):  # no branch, since no processor could predict it
        found[number] = k
        number += spare[k] > 0.0
    return number


@compiled
def _write_nearest(
    mask: FlatObservation,
    rows: FlatObservation,
    focus: float,
    view: float,
    position: Array,
    cos: float,
    sin: float,
    columns: Array,
    radii: Array,
    cores: Cores,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Write mask (K,) and obstacles (4 K,): those within view, nearest to the focus first."""
    near, share = work[1], 1.0 / view
    x, y = position[0] + focus * cos, position[1] + focus * sin
    number = _within(view, x, y, columns, radii, work[0], found)
    for m in range(number):
        k = found[m]
        along, across = columns[0, k] - x, columns[1, k] - y
        near[m] = np.sqrt(along * along + across * across) - radii[k]
    if len(cores.first) > 0:
        number = keep_within(view, x, y, cores, number, found, near)
    for j in range(len(mask)):
        mask[j] = 0.0
    for j in range(len(rows)):
        rows[j] = 0.0
    for m in range(number):
        j = 0
        for other in range(number):
            j += near[other] < near[m]
        while j < len(mask) and mask[j] > 0.0:  # taken by an obstacle at the same distance
            j += 1
        if j < len(mask):
            k = found[m]
            if has_core(cores, k):
                at_x, at_y, distance = nearest_outline_point(position[0], position[1], cores, k)
                x, y, radius = at_x - position[0], at_y - position[1], cores.radii[k]
            else:
                x, y, radius = columns[0, k] - position[0], columns[1, k] - position[1], radii[k]
                distance = np.sqrt(x * x + y * y) - radius
            rows[4 * j] = _clipped((cos * x + sin * y) * share)
            rows[4 * j + 1] = _clipped((cos * y - sin * x) * share)
            rows[4 * j + 2] = _clipped(radius * share)
            rows[4 * j + 3] = _clipped(distance * share)
            mask[j] = 1.0


@compiled
def _write_ranges(
    ranges: FlatObservation,
    directions: FlatObservation,
    far: float,
    position: Array,
    turn: complex,
    bounds: Array,
    columns: Array,
    radii: Array,
    cores: Cores,
    work: Array,
    found: NDArray[np.int64],
) -> None:
    """Write ranges (R,) to the nearest obstacle or bound along directions (2, R).

    Loops over rays have no branches and single precision, so that they become vector
    instructions; the result is of single precision anyway.
    """
    cos, sin = np.float32(turn.real), np.float32(turn.imag)
    none, one = np.float32(0.0), np.float32(1.0)
    tiny = np.float32(1e-30)
    west, east = np.float32(bounds[0, 0] - position[0]), np.float32(bounds[1, 0] - position[0])
    south, north = np.float32(bounds[0, 1] - position[1]), np.float32(bounds[1, 1] - position[1])
    view = np.float32(far)
    for j in range(len(ranges)):
        x = cos * directions[0, j] - sin * directions[1, j]
        y = sin * directions[0, j] + cos * directions[1, j]
        x = x if abs(x) > tiny else tiny
        y = y if abs(y) > tiny else tiny
        along = (east if x > none else west) / x
        across = (north if y > none else south) / y
        reach = along if along < across else across
        reach = reach if reach < view else view
        ranges[j] = reach if reach > none else none
    for m in range(_within(far, position[0], position[1], columns, radii, work[0], found)):
        k = found[m]
        if has_core(cores, k):
            shorten_by_core(ranges, directions, position[0], position[1], turn, far, cores, k)
            continue
        x, y = columns[0, k] - position[0], columns[1, k] - position[1]
        ahead, left = turn.real * x + turn.imag * y, turn.real * y - turn.imag * x
        shorten_by_arc(ranges, directions, ahead, left, radii[k])
    for j in range(len(ranges)):
        ranges[j] *= one / view
