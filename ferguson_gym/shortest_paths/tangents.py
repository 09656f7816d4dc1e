"""Tangents of discs, and those from a point to an obstacle.

A shortest path consists of straight lines and of parts of obstacles' boundaries, which lines touch
at their ends. The path follows an obstacle on its right clockwise, sense -1, and one on its left
counter-clockwise, sense +1. Track 2 i is the boundary of obstacle i with sense +1, track 2 i + 1
with sense -1; angles are those of outward normals, measured in the track's sense, so that they grow
along it. A point is a disc of radius zero.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Shapes,
    corner_at,
    end_of,
    is_disc,
    last_corner,
    nearest_feature,
    straight_parts,
    sweep,
    within_range,
)


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
def corner_angle(shapes: Shapes, i: int, corner: int, sense: float, ux: float, uy: float) -> float:
    """As `angle`, within the range of a corner of obstacle i that a tangent touches."""
    shapes = unowned(shapes)  # the caller holds it
    at = angle(sense, ux, uy)
    counter = at if sense > 0.0 else -at % TWO_PI
    inside = within_range(shapes, i, corner, counter)
    if inside == counter:
        return at
    return inside if sense > 0.0 else -inside % TWO_PI


@compiled
def arc_length(scene: Scene, track: int, before: float, after: float) -> float:
    """Length of a track between two angles [m], less than once around."""
    turn = sweep(before, after)
    if len(scene.shapes.first) == 0:
        return float(scene.discs[track // 2].radius * turn)
    straight = straight_parts(scene.shapes, track, before, after)
    return float(scene.shapes.radii[track // 2] * turn + straight)


@compiled
def point_of(scene: Scene, track: int, at: float) -> tuple[float, float]:
    """The point of a track at an angle [m]."""
    disc, shapes, sense = scene.discs[track // 2], scene.shapes, 1.0 - 2.0 * (track % 2)
    x, y, radius = disc.x, disc.y, disc.radius
    if not is_disc(shapes, track // 2):
        angle = at % TWO_PI
        c = corner_at(shapes, track // 2, angle if sense > 0.0 else TWO_PI - angle)
        x, y, radius = shapes.corners[c].x, shapes.corners[c].y, shapes.radii[track // 2]
    return x + radius * np.cos(at), y + sense * radius * np.sin(at)


_CONTACT = 1e-3
"""Distance at which a point counts as on a boundary, in margins: far above rounding."""


class Touch(NamedTuple):
    """A tangent from a point to a track."""

    length: float
    """[m]."""
    ux: float
    """Unit direction."""
    uy: float
    at: float
    """Angle at which it reaches the track [rad]."""


@compiled
def tangent_from(scene: Scene, track: int, x: float, y: float) -> Touch:
    """The tangent from a point [m] to a track, whether or not other obstacles obstruct it.

    From a point on the boundary or, by a tolerance, inside it is the way to where the track goes
    on: to the end of the edge that the point lies on, or nothing at all.
    """
    disc, shapes, sense = scene.discs[track // 2], scene.shapes, 1.0 - 2.0 * (track % 2)
    if is_disc(shapes, track // 2):
        length, ux, uy = tangent(disc.x - x, disc.y - y, sense * disc.radius)
        return Touch(length, ux, uy, angle(sense, ux, uy))
    return tangent_to_shape(shapes, scene.margin, track, x, y)


@compiled
def tangent_to_shape(shapes: Shapes, margin: float, track: int, x: float, y: float) -> Touch:
    """As `tangent_from`, to the track of an obstacle that is no disc."""
    shapes = unowned(shapes)  # the caller holds it
    i, sense, radius = track // 2, 1.0 - 2.0 * (track % 2), shapes.radii[track // 2]
    near, contact = nearest_feature(shapes, i, x, y), _CONTACT * margin
    c = near.corner
    if near.distance - radius > contact:
        c = _touched(shapes, i, c, sense, x, y)
    else:
        behind = last_corner(shapes, i, c)
        on_corner = radius <= margin and not near.is_edge
        if radius <= margin and near.is_edge:
            # a corner is also a part of the edges beside it
            if _apart(shapes, c, x, y) <= margin:
                on_corner = True
            elif _apart(shapes, behind, x, y) <= margin:
                c, on_corner = behind, True
        if on_corner:
            # lines from a point on a corner replace those that leave the corner
            at = end_of(shapes, i, c) if sense > 0.0 else -shapes.corners[c].begin % TWO_PI
            return _to_corner(shapes, contact, track, c, at, x, y)
        if near.is_edge:
            c = c if sense > 0.0 else behind
            at = shapes.corners[c].begin if sense > 0.0 else -end_of(shapes, i, c) % TWO_PI
            return _to_corner(shapes, contact, track, c, at, x, y)
    corner = shapes.corners[c]
    length, ux, uy = tangent(corner.x - x, corner.y - y, sense * radius)
    at = corner_angle(shapes, i, c, sense, ux, uy)
    if near.distance - radius <= contact and at != angle(sense, ux, uy):
        return _to_corner(shapes, contact, track, c, at, x, y)
    return Touch(length, ux, uy, at)


@compiled
def _apart(shapes: Shapes, corner: int, x: float, y: float) -> float:
    """Distance of a point from a corner [m]."""
    q = shapes.corners[corner]
    return float(np.sqrt((q.x - x) ** 2 + (q.y - y) ** 2))


@compiled
def _touched(shapes: Shapes, i: int, nearest: int, sense: float, x: float, y: float) -> int:
    """The corner that the tangent from a point outside touches."""
    shapes = unowned(shapes)  # the caller holds it
    first, end = shapes.first[i], shapes.first[i + 1]
    radius = shapes.radii[i]
    last = shapes.corners[end - 1]
    before = (x - last.x) * last.nx + (y - last.y) * last.ny > radius
    for c in range(first, end):
        corner = shapes.corners[c]
        # whether the point lies beyond the edge that ends at the corner
        beyond = (x - corner.x) * corner.nx + (y - corner.y) * corner.ny > radius
        if sense > 0.0 and before and not beyond:
            return last_corner(shapes, i, c)
        if sense < 0.0 and beyond and not before:
            return last_corner(shapes, i, c)
        before = beyond
    return nearest


@compiled
def _to_corner(
    shapes: Shapes, contact: float, track: int, corner: int, at: float, x: float, y: float
) -> Touch:
    """The line from a point to a track at an angle within the range of a corner."""
    sense = 1.0 - 2.0 * (track % 2)
    q, radius = shapes.corners[corner], shapes.radii[track // 2]
    dx = q.x + radius * math.cos(at) - x
    dy = q.y + sense * radius * math.sin(at) - y
    length = np.sqrt(dx * dx + dy * dy)
    if length > contact:
        return Touch(length, dx / length, dy / length, at)
    return Touch(length, -math.sin(at), sense * math.cos(at), at)
