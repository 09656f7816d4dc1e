"""What a pilot sees: numbers in [-1, 1], in a frame that is turned with the vehicle."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.actions import heading, share_of_steepest
from ferguson_gym.arrays import Array
from ferguson_gym.compilation import compiled

Observation: TypeAlias = dict[str, NDArray[np.float32]]
Single: TypeAlias = NDArray[np.float32]

VIEW = 30.0
"""Lengths in observations are parts of this [m], two of the longest segments."""

KINDS = ("discs", "rays")
"""What obstacles are seen as: the nearest discs, or ranges along rays (a lidar)."""


class Sight(NamedTuple):
    """Observations of N vehicles; what a kind does not show has size zero."""

    vehicle: Single
    """(N, 6)."""
    goal: Single
    """(N, 3)."""
    obstacles: Single
    """(N, 4 K)."""
    mask: Single
    """(N, K)."""
    rays: Single
    """(N, R)."""


def shapes(kind: str, nearest: int, rays: int) -> dict[str, tuple[int, ...]]:
    """Shape of each entry of one vehicle's observation, in order."""
    common: dict[str, tuple[int, ...]] = {"vehicle": (6,), "goal": (3,)}
    if kind == "rays":
        return common | {"rays": (rays,)}
    return common | {"obstacles": (4 * nearest,), "mask": (nearest,)}


def empty_sight(entries: dict[str, tuple[int, ...]], number: int) -> Sight:
    """Memory for the observations of a number of vehicles."""
    none = {"obstacles": (0,), "mask": (0,), "rays": (0,)}
    return Sight(
        *(np.empty((number, *(entries.get(key) or none[key])), np.float32) for key in Sight._fields)
    )


@compiled
def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)


@compiled
def look(
    sight: Sight,
    i: int,
    position: Array,
    derivative: Array,
    left: float,
    goal: Array,
    bounds: Array,
    columns: Array,
    radii: Array,
    focus: float,
    work: Any,
) -> None:
    """Fill row i of the observations; the environment's docstring says with what.

    Args:
        sight: where it is written.
        i: the row.
        position: (2,) [m].
        derivative: (2,) [m per unit t].
        left: segments left, part of all.
        goal: (2,) [m].
        bounds: (2, 2) [m].
        columns: (2, M) centres of the discs.
        radii: (M,); rows of padding have a radius of minus infinity.
        focus: discs are seen that are nearest to the point this far ahead [m].
        work: scratch (3, M).
    """
    turn = heading(derivative[0], derivative[1])
    cos, sin = turn.real, turn.imag
    for d in range(2):
        low, high = bounds[0, d], bounds[1, d]
        sight.vehicle[i, d] = _clipped(2.0 * (position[d] - low) / (high - low) - 1.0)
    sight.vehicle[i, 2] = _clipped(cos)
    sight.vehicle[i, 3] = _clipped(sin)
    speed = np.sqrt(derivative[0] ** 2 + derivative[1] ** 2)
    sight.vehicle[i, 4] = _clipped(share_of_steepest(speed))
    sight.vehicle[i, 5] = left

    x, y = goal[0] - position[0], goal[1] - position[1]
    distance = np.sqrt(x * x + y * y)
    diagonal = np.sqrt((bounds[1, 0] - bounds[0, 0]) ** 2 + (bounds[1, 1] - bounds[0, 1]) ** 2)
    sight.goal[i, 0] = _clipped(distance / diagonal)
    sight.goal[i, 1] = _clipped((cos * x + sin * y) / distance) if distance > 0.0 else 1.0
    sight.goal[i, 2] = _clipped((cos * y - sin * x) / distance) if distance > 0.0 else 0.0

    if sight.mask.shape[1] > 0:
        _nearest(sight, i, position, cos, sin, columns, radii, focus, work)
    if sight.rays.shape[1] > 0:
        _ranges(sight.rays[i], position, turn, bounds, columns, radii)


@compiled
def _nearest(
    sight: Sight,
    i: int,
    position: Array,
    cos: float,
    sin: float,
    columns: Array,
    radii: Array,
    focus: float,
    work: Any,
) -> None:
    number, discs = sight.mask.shape[1], len(radii)
    distance, near, disc = work[0], work[1], work[2]
    x, y = position[0] + focus * cos, position[1] + focus * sin
    for k in range(discs):
        along, across = columns[0, k] - x, columns[1, k] - y
        distance[k] = np.sqrt(along * along + across * across) - radii[k]
    seen = 0
    for k in range(discs):  # without a branch, which no processor could predict
        near[seen], disc[seen] = distance[k], k
        seen += distance[k] < VIEW
    rows, mask = sight.obstacles[i], sight.mask[i]
    rows[:] = 0.0
    mask[:] = 0.0
    for m in range(seen):
        j = 0
        for other in range(seen):
            j += near[other] < near[m]
        while j < number and mask[j] > 0.0:  # taken by one at the same distance
            j += 1
        if j < number:
            k = int(disc[m])
            x, y = columns[0, k] - position[0], columns[1, k] - position[1]
            rows[4 * j] = _clipped((cos * x + sin * y) / VIEW)
            rows[4 * j + 1] = _clipped((cos * y - sin * x) / VIEW)
            rows[4 * j + 2] = _clipped(radii[k] / VIEW)
            rows[4 * j + 3] = _clipped((np.sqrt(x * x + y * y) - radii[k]) / VIEW)
            mask[j] = 1.0


@compiled
def _ray(j: int, rays: int) -> complex:
    angle = 2.0 * np.pi * j / rays
    return complex(np.cos(angle), np.sin(angle))


@compiled
def _ranges(
    rays: Single, position: Array, turn: complex, bounds: Array, columns: Array, radii: Array
) -> None:
    for j in range(len(rays)):
        way = turn * _ray(j, len(rays))
        reach = VIEW
        for d in range(2):
            step = way.real if d == 0 else way.imag
            if step != 0.0:
                wall = bounds[1, d] if step > 0.0 else bounds[0, d]
                reach = min(reach, (wall - position[d]) / step)
        rays[j] = max(reach, 0.0) / VIEW
    for k in range(len(radii)):
        x, y = columns[0, k] - position[0], columns[1, k] - position[1]
        if not radii[k] > 0.0 or x * x + y * y >= (VIEW + radii[k]) ** 2:
            continue
        for j in range(len(rays)):
            way = turn * _ray(j, len(rays))
            along, across = way.real * x + way.imag * y, way.real * y - way.imag * x
            half2 = radii[k] * radii[k] - across * across
            if along > 0.0 and half2 > 0.0:
                rays[j] = min(rays[j], max(along - np.sqrt(half2), 0.0) / VIEW)
