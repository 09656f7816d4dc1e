"""Common tangents of discs, and whether they are free of collisions.

A shortest path among discs consists of straight lines and of arcs along discs, and its lines touch
the discs at their ends. The path follows a disc on its right clockwise, sense -1, and a disc on its
left counter-clockwise, sense +1. A point is a disc of radius zero.

One margin separates free from blocked, 1e-9 of the field's size (1e-7 m in the paper's fields): a
line or arc may cut into a disc or leave the bounds by that much. A path can therefore pass between
two discs that touch, or that overlap by no more than the margin, and through any passage, however
narrow. Discs smaller than the margin are ignored.

Reference:
    Laumond (1987), Obstacle growing in a nonpolygonal world, Information Processing Letters 25.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.field import Field

Integers = NDArray[np.int64]

MARGIN = 1e-9
"""Depth to which a path may cut into a disc or leave the bounds, relative to the field's size."""
TWO_PI = 2.0 * math.pi

Records = NDArray[np.void]
"""An array of DISC."""

DISC = np.dtype(
    [
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("radius", np.float64),  # [m]
        ("reach", np.float64),  # distance from the centre below which a point counts as inside [m]
    ]
)


class Scene(NamedTuple):
    """The discs that can obstruct a path: not those within another disc or outside the bounds."""

    discs: Records
    """(n,); their reach is the radius less the margin."""
    box: Array
    """(2, 2) lower and upper bounds of the coordinates, enlarged by the margin [m]."""
    margin: float
    """[m]."""


class View(NamedTuple):
    """Discs in the order of their distance from a point."""

    order: Integers
    """(n,) discs."""
    near: Array
    """(n,) distance of each from the point [m], increasing."""


class Tangents(NamedTuple):
    """Common tangents of discs that are free of collisions.

    Track 2 i is disc i traversed counter-clockwise (sense +1), track 2 i + 1 clockwise (sense -1).
    Angles are measured in the track's sense, so that they grow along it. Reversed, a tangent leads
    from track `arrive ^ 1` to `leave ^ 1`, and angles change sign.
    """

    leave: Integers
    """(m,) track that is left."""
    arrive: Integers
    """(m,) track that is reached."""
    angles: Array
    """(m, 2) of the point that is left and of the point that is reached, in [0, 2 pi)."""
    length: Array
    """(m,) [m]."""


def scene(field: Field) -> tuple[Scene, Integers]:
    """The discs of a field that can obstruct a path, and their indices among the field's discs.

    Raises:
        TypeError: obstacles other than discs in the plane.
    """
    discs = field.obstacles
    if not discs.are_discs or discs.dimension != 2:
        raise TypeError(
            "shortest paths are found among discs in the plane, got "
            f"{type(discs).__name__} in {discs.dimension} dimensions"
        )
    low, high = field.bounds
    far = np.abs(discs.centers).max(axis=1) + discs.radii if len(discs) else np.zeros(1)
    # the second term is rounding, which matters for discs that are huge beside the field
    margin = MARGIN * float((high - low).max()) + 1e-14 * float(
        max(far.max(), np.abs(field.bounds).max())
    )
    order = np.argsort(-discs.radii, kind="stable")
    kept = np.flatnonzero(_matters(discs.centers, discs.radii, order, low, high, margin))
    records = np.empty(len(kept), dtype=DISC)
    records["x"], records["y"] = discs.centers[kept].T
    records["radius"] = discs.radii[kept]
    records["reach"] = discs.radii[kept] - margin
    return Scene(records, np.stack([low - margin, high + margin]), margin), kept


@compiled
def _matters(
    centers: Array, radii: Array, order: Integers, low: Array, high: Array, margin: float
) -> NDArray[np.bool_]:
    """Whether a disc reaches into the bounds and is not contained in a disc before it in order."""
    matters = np.zeros(len(radii), dtype=np.bool_)
    count = len(radii)
    # a disc within another has its centre there: candidates stand in the cells that they reach
    size = max(np.sqrt((high[0] - low[0]) * (high[1] - low[1]) / max(count, 1)), 1e-300)
    for radius in radii:
        size += radius / count
    columns, rows = int((high[0] - low[0]) / size) + 1, int((high[1] - low[1]) / size) + 1
    latest = np.full((columns, rows), -1)
    links = [(0, 0) for _ in range(0)]
    for i in order:
        x, y, radius = centers[i, 0], centers[i, 1], radii[i]
        beyond_x = max(low[0] - x, x - high[0], 0.0)
        beyond_y = max(low[1] - y, y - high[1], 0.0)
        if not (radius > margin and np.hypot(beyond_x, beyond_y) < radius):
            continue
        matters[i] = True
        link = latest[_cell(x - low[0], size, columns), _cell(y - low[1], size, rows)]
        while link >= 0 and matters[i]:
            k, link = links[link]
            apart = np.hypot(centers[k, 0] - x, centers[k, 1] - y)
            matters[i] = apart + radius > radii[k] + margin
        if not matters[i]:
            continue
        left = _cell(x - radius - low[0], size, columns)
        right = _cell(x + radius - low[0], size, columns)
        bottom = _cell(y - radius - low[1], size, rows)
        top = _cell(y + radius - low[1], size, rows)
        for column in range(left, right + 1):
            for row in range(bottom, top + 1):
                links.append((i, latest[column, row]))
                latest[column, row] = len(links) - 1
    return matters


@compiled
def _cell(offset: float, size: float, number: int) -> int:
    """Which of some cells of a size holds an offset [m]; the first or last one if none does."""
    return int(min(max(offset / size, 0.0), number - 1.0))


@compiled
def view(discs: Records, x: float, y: float) -> View:
    """The discs in the order of their distance from a point."""
    near = np.empty(len(discs))
    for k in range(len(discs)):
        disc = discs[k]
        near[k] = np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2) - disc.radius
    order = np.argsort(near)
    return View(order, near[order])


@compiled
def tangent(x: float, y: float, across: float) -> tuple[float, float, float]:
    """Length [m] and unit direction of a tangent of two discs whose centres differ by (x, y) [m].

    `across` is sense times radius of the second disc minus that of the first [m]; where it exceeds
    the centres' distance the discs are taken to touch. NaN if the centres coincide.
    """
    square = x * x + y * y
    length = np.sqrt(max(square - across * across, 0.0))
    if length == 0.0:
        across = math.copysign(np.sqrt(square), across)
    return length, (length * x + across * y) / square, (length * y - across * x) / square


@compiled
def angle(sense: float, ux: float, uy: float) -> float:
    """Angle in [0, 2 pi), in a track's sense, where its direction of travel is (ux, uy)."""
    # seen from the centre, the point lies in the direction (uy, -ux) times the sense
    return math.atan2(-ux, sense * uy) % TWO_PI


@compiled
def is_within(box: Array, x: float, y: float) -> bool:
    """Whether a point lies in a box (2, 2) of lower and upper bounds."""
    within: bool = box[0, 0] <= x <= box[1, 0] and box[0, 1] <= y <= box[1, 1]
    return within


@compiled
def is_clear(
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    far: float,
    discs: Records,
    view: View,
    one: int,
    other: int,
) -> bool:
    """Whether a line from (x, y) in a unit direction meets no disc except `one` and `other`.

    The line touches these two; -1 stands for none. All points of the line must lie within `far` [m]
    of the point for which `view` was computed.
    """
    for place in range(len(discs)):
        if view.near[place] >= far:
            break
        k = view.order[place]
        if k in (one, other):
            continue
        disc = discs[k]
        dx, dy = disc.x - x, disc.y - y
        beside = dx * uy - dy * ux
        if abs(beside) >= disc.reach:
            continue
        along = dx * ux + dy * uy
        beyond = -along if along < 0.0 else max(along - length, 0.0)
        if beside * beside + beyond * beyond < disc.reach * disc.reach:
            return False
    return True


@compiled
def tangents(scene: Scene) -> Tangents:
    """All collision-free common tangents of discs that end inside the bounds."""
    discs = scene.discs
    room, count = 256, 0
    leave, arrive = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    angles, lengths = np.empty((room, 2)), np.empty(room)
    for i in range(len(discs)):
        one = discs[i]
        around = view(discs, one.x, one.y)
        for j in range(i + 1, len(discs)):
            two = discs[j]
            x, y = two.x - one.x, two.y - one.y
            apart = np.sqrt(x * x + y * y)
            for kind in range(4):
                left, right = 1.0 - 2.0 * (kind // 2), 1.0 - 2.0 * (kind % 2)
                r, s = left * one.radius, right * two.radius
                if abs(s - r) > apart + scene.margin:
                    continue
                length, ux, uy = tangent(x, y, s - r)
                x0, y0, far = one.x + r * uy, one.y - r * ux, np.sqrt(length * length + r * r)
                if not is_within(scene.box, x0, y0):
                    continue
                if not is_within(scene.box, two.x + s * uy, two.y - s * ux):
                    continue
                if not is_clear(x0, y0, ux, uy, length, far, discs, around, i, j):
                    continue
                if count == room:
                    room *= 2
                    leave = np.append(leave, np.empty_like(leave))
                    arrive = np.append(arrive, np.empty_like(arrive))
                    lengths = np.append(lengths, np.empty_like(lengths))
                    angles = np.append(angles, np.empty_like(angles)).reshape(room, 2)
                leave[count], arrive[count] = 2 * i + kind // 2, 2 * j + kind % 2
                angles[count, 0], angles[count, 1] = angle(left, ux, uy), angle(right, ux, uy)
                lengths[count] = length
                count += 1
    return Tangents(leave[:count], arrive[:count], angles[:count], lengths[:count])
