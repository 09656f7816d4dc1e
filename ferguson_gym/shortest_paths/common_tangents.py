"""All common tangents of obstacles that are free of collisions.

Two convex sets have a common tangent wherever the difference of their support functions changes its
sign: for lines with both on the same side, that of the one and the other, for lines between them
that of the one and the other's mirror image. Between two normals of edges the same two corners
support both sets, the difference is a sinusoid, and the tangent is one of two discs. Signs are
asked once for each normal of an edge, so that neither rounding nor edges that lie on one line can
lose a tangent or count it twice.

References:
    Laumond (1987), Obstacle growing in a nonpolygonal world, Information Processing Letters 25.
    Toussaint (1983), Solving geometric problems with the rotating calipers, IEEE MELECON.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from ferguson_gym.shortest_paths.scene import Scene, comes_within, discs_within, view
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Integers,
    Shapes,
    corner_at,
    enters,
    is_disc,
    sweep,
)
from ferguson_gym.shortest_paths.tangents import angle, corner_angle, is_within, point_of, tangent

_HALF_TURN = np.pi


class Tangents(NamedTuple):
    """Common tangents of obstacles that are free of collisions.

    Tracks and angles are those of `tangents`. Reversed, a tangent leads from track `arrive ^ 1` to
    `leave ^ 1`, and angles change sign.
    """

    leave: Integers
    """(m,) track that is left."""
    arrive: Integers
    """(m,) track that is reached."""
    angles: Array
    """(m, 2) of the point that is left and of the point that is reached, in [0, 2 pi)."""
    length: Array
    """(m,) [m]."""


@compiled
def tangents(scene: Scene, known: int) -> Tangents:
    """All collision-free common tangents of obstacles that end inside the bounds.

    Without those of the first obstacles among themselves, in a number that are `known`.
    """
    scene = unowned(scene)  # the caller holds it
    discs, box, shapes = scene.discs, scene.box, scene.shapes
    owned = discs_within(scene)
    within, nearby = unowned(owned), np.empty((len(discs), 4))
    only_discs = len(shapes.first) == 0  # asked once, since passing shapes on costs time
    room, count, most = 256, 0, 1
    leave, arrive = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    angles, lengths = np.empty((room, 2)), np.empty(room)
    for i in range(len(shapes.first) - 1):
        most = max(most, shapes.first[i + 1] - shapes.first[i])
    touching = np.empty((16 * most, 4), dtype=np.int64)
    for i in range(len(discs)):
        one = discs[i]
        around = view(discs, one.x, one.y)
        order, near = unowned(around)
        for place in range(len(discs)):
            k = order[place]
            disc = within[k]
            nearby[place, 0], nearby[place, 1] = disc.x, disc.y
            nearby[place, 2], nearby[place, 3] = disc.reach if k != i else -1.0, near[place]
        for j in range(max(i + 1, known), len(discs)):
            two = discs[j]
            x, y = two.x - one.x, two.y - one.y
            apart = np.sqrt(x * x + y * y)
            both_discs = only_discs or (is_disc(shapes, i) and is_disc(shapes, j))
            number = 4
            if not both_discs and apart > one.radius + two.radius + scene.margin:
                _touching_apart(shapes, i, j, x, y, (one.radius + two.radius) / apart, touching)
            elif not both_discs:
                number = _touching(shapes, i, j, scene.margin, touching)
            x_one, y_one, radius_one = one.x, one.y, one.radius
            x_two, y_two, radius_two = two.x, two.y, two.radius
            for kind in range(number):
                left, right, a, b = 1.0 - 2.0 * (kind // 2), 1.0 - 2.0 * (kind % 2), 0, 0
                if not both_discs:
                    a, b = touching[kind, 0], touching[kind, 1]
                    left, right = float(touching[kind, 2]), float(touching[kind, 3])
                    x_one, y_one = shapes.corners[a].x, shapes.corners[a].y
                    x_two, y_two = shapes.corners[b].x, shapes.corners[b].y
                    radius_one, radius_two = shapes.radii[i], shapes.radii[j]
                    x, y = x_two - x_one, y_two - y_one
                    if x == 0.0 and y == 0.0:
                        continue
                r, s = left * radius_one, right * radius_two
                if both_discs and abs(s - r) > apart + scene.margin:
                    continue
                length, ux, uy = tangent(x, y, s - r)
                x0, y0, far = x_one + r * uy, y_one - r * ux, np.sqrt(length * length + r * r)
                if not is_within(box, x0, y0):
                    continue
                if not is_within(box, x_two + s * uy, y_two - s * ux):
                    continue
                if not both_discs:
                    dx, dy = x0 - one.x, y0 - one.y
                    far = np.sqrt(dx * dx + dy * dy)
                    dx, dy = x_two + s * uy - one.x, y_two - s * ux - one.y
                    far = max(far, np.sqrt(dx * dx + dy * dy))
                if _is_blocked(nearby, order, x0, y0, ux, uy, length, far, j):
                    continue
                if not only_discs and _enters_any(
                    scene, order, near, x0, y0, ux, uy, length, far, i, j
                ):
                    continue
                if count == room:
                    room *= 2
                    leave = np.append(leave, np.empty_like(leave))
                    arrive = np.append(arrive, np.empty_like(arrive))
                    lengths = np.append(lengths, np.empty_like(lengths))
                    angles = np.append(angles, np.empty_like(angles)).reshape(room, 2)
                leave[count] = 2 * i + (0 if left > 0.0 else 1)
                arrive[count] = 2 * j + (0 if right > 0.0 else 1)
                angles[count, 0], angles[count, 1] = angle(left, ux, uy), angle(right, ux, uy)
                if not (only_discs or is_disc(shapes, i)):
                    angles[count, 0] = corner_angle(shapes, i, a, left, ux, uy)
                if not (only_discs or is_disc(shapes, j)):
                    angles[count, 1] = corner_angle(shapes, j, b, right, ux, uy)
                lengths[count] = length
                count += 1
        if len(around.near) + len(owned) < 0:  # a last use, which keeps their memory alive
            break
    return Tangents(leave[:count], arrive[:count], angles[:count], lengths[:count])


@compiled
def more_tangents(scene: Scene, known: int, lines: Tangents) -> Tangents:
    """All tangents of a scene, given the lines that are free among the first `known` obstacles."""
    scene = unowned(scene)  # the caller holds it
    discs, shapes = scene.discs, scene.shapes
    free = np.ones(len(lines.length), dtype=np.bool_)
    for line in range(len(free)):
        track, at, length = lines.leave[line], lines.angles[line, 0], lines.length[line]
        x, y = point_of(scene, track, at)
        ux, uy = -math.sin(at), (1.0 - 2.0 * (track % 2)) * math.cos(at)
        for k in range(known, len(discs)):
            if comes_within(discs[k].x - x, discs[k].y - y, discs[k].reach, ux, uy, length) and (
                is_disc(shapes, k) or enters(x, y, ux, uy, length, shapes, k)
            ):
                free[line] = False
                break
    more = tangents(scene, known)
    return Tangents(
        np.append(lines.leave[free], more.leave),
        np.append(lines.arrive[free], more.arrive),
        np.append(lines.angles[free], more.angles).reshape(-1, 2),
        np.append(lines.length[free], more.length),
    )


@compiled
def _is_blocked(
    nearby: Array,
    order: Integers,
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    far: float,
    other: int,
) -> bool:
    """Whether a line from (x, y) comes within the reach of a disc that is not `other`.

    The discs (n, 4) have x, y, reach and distance from the view's point [m], which increases. It
    spares most lines the test of the shapes around the discs.
    """
    for place in range(len(nearby)):
        if nearby[place, 3] >= far:
            break
        dx, dy, reach = nearby[place, 0] - x, nearby[place, 1] - y, nearby[place, 2]
        if comes_within(dx, dy, reach, ux, uy, length) and order[place] != other:
            return True
    return False


@compiled
def _enters_any(
    scene: Scene,
    order: Integers,
    near: Array,
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    far: float,
    one: int,
    other: int,
) -> bool:
    """Whether a line enters an obstacle that is no disc, except `one` and `other`."""
    scene = unowned(scene)  # the caller holds it
    discs, first = scene.discs, scene.shapes.first
    for place in range(len(order)):
        if near[place] >= far:
            break
        k = order[place]
        if k in (one, other) or not comes_within(
            discs[k].x - x, discs[k].y - y, discs[k].reach, ux, uy, length
        ):
            continue
        if first[k + 1] - first[k] > 1 and enters(x, y, ux, uy, length, scene.shapes, k):
            return True
    return False


@compiled
def _touching(shapes: Shapes, i: int, j: int, margin: float, touching: Integers) -> int:
    """Fill rows with the corners of obstacles i and j that common tangents touch.

    Each row is followed by the senses of the tracks that are left and reached. Returns the number
    of rows.
    """
    number = _on_sides(shapes, i, j, 1.0, margin, touching, 0)
    return _on_sides(shapes, i, j, -1.0, margin, touching, number)


@compiled
def _touching_apart(
    shapes: Shapes, i: int, j: int, x: float, y: float, width: float, touching: Integers
) -> None:
    """As `_touching`, of obstacles whose bounding discs are apart: four tangents.

    Args:
        shapes: of all obstacles.
        i: the first obstacle.
        j: the second one.
        x: from the first bounding disc's centre to the second one's [m].
        y: likewise.
        width: sum of the bounding discs' radii, relative to the distance of their centres.
        touching: filled.
    """
    shapes = unowned(shapes)  # the caller holds it
    corners, first, other_first = shapes.corners, shapes.first[i], shapes.first[j]
    end, other_end = shapes.first[i + 1], shapes.first[j + 1]
    # normals of tangents are within half of a range around each perpendicular to the centres' line
    half, middle = math.asin(width), math.atan2(y, x)
    for window in range(2):
        begin = (middle + (0.5 - window) * _HALF_TURN - half) % TWO_PI
        opposite = begin - _HALF_TURN if begin >= _HALF_TURN else begin + _HALF_TURN
        starts = (corner_at(shapes, j, begin), corner_at(shapes, j, opposite))
        start = corner_at(shapes, i, begin)
        for kind in range(2):
            side, a, b = 1.0 - 2.0 * kind, start, starts[kind]
            radius = shapes.radii[i] - side * shapes.radii[j]
            other_begin = begin if kind == 0 else opposite
            # on one side of the range the difference of support functions is below zero, and above
            # it on the other
            while True:
                next_a = a + 1 if a + 1 < end else first
                next_b = b + 1 if b + 1 < other_end else other_first
                ahead, other_ahead = 2.0 * half, 2.0 * half
                if end - first > 1:
                    ahead = sweep(begin, corners[next_a].begin)
                if other_end - other_first > 1:
                    other_ahead = sweep(other_begin, corners[next_b].begin)
                if min(ahead, other_ahead) >= 2.0 * half:
                    break
                nx, ny = corners[next_a].nx, corners[next_a].ny
                if other_ahead < ahead:
                    nx, ny = side * corners[next_b].nx, side * corners[next_b].ny
                dx, dy = corners[a].x - corners[b].x, corners[a].y - corners[b].y
                if (nx * dx + ny * dy + radius >= 0.0) == (window == 0):
                    break
                if other_ahead < ahead:
                    b = next_b
                else:
                    a = next_a
            place, sense = 2 * kind + window, 2 * window - 1
            touching[place, 0], touching[place, 1] = a, b
            touching[place, 2] = sense
            touching[place, 3] = sense if kind == 0 else -sense


@compiled
def _on_sides(
    shapes: Shapes, i: int, j: int, side: float, margin: float, touching: Integers, number: int
) -> int:
    """As `_touching`, for lines with the obstacles on the same side, 1, or on both sides, -1."""
    shapes = unowned(shapes)  # the caller holds it
    corners = shapes.corners
    first, end = shapes.first[i], shapes.first[i + 1]
    other_first, other_end = shapes.first[j], shapes.first[j + 1]
    # normals of edges; a disc has none. Those of the second one are turned by half a turn
    edges = end - first if end - first > 1 else 0
    other_edges = other_end - other_first if other_end - other_first > 1 else 0
    start = other_first
    if side < 0.0:
        while start < other_end and corners[start].begin < _HALF_TURN:
            start += 1
    a, b = end - 1, (start if start > other_first else other_end) - 1
    radius = shapes.radii[i] - side * shapes.radii[j]
    if side < 0.0:
        radius -= margin
    # the last normal before angle zero
    nx, ny = corners[a].nx, corners[a].ny
    if other_edges > 0 and (edges == 0 or _turned(corners[b].begin, side) > corners[a].begin):
        nx, ny = side * corners[b].nx, side * corners[b].ny
    value = nx * (corners[a].x - corners[b].x) + ny * (corners[a].y - corners[b].y) + radius
    place, other_place = 0, 0
    while place < edges or other_place < other_edges:
        before, before_x, before_y = value >= 0.0, nx, ny
        dx, dy = corners[a].x - corners[b].x, corners[a].y - corners[b].y
        next_b = start + other_place
        next_b = next_b if next_b < other_end else next_b - other_edges
        next_a = first + place
        is_first = place < edges
        if is_first and other_place < other_edges:
            is_first = corners[next_a].begin <= _turned(corners[next_b].begin, side)
        if is_first:
            nx, ny = corners[next_a].nx, corners[next_a].ny
        else:
            nx, ny = side * corners[next_b].nx, side * corners[next_b].ny
        value = nx * dx + ny * dy + radius
        after = value >= 0.0
        falls, rises = before and not after, after and not before
        if before == after:
            # both signs occur where the sinusoid has its extremum between the two normals
            sign = -1.0 if before else 1.0
            turned = before_x * dy - before_y * dx, dx * ny - dy * nx
            if sign * turned[0] > 0.0 and sign * turned[1] > 0.0:
                extreme = radius + sign * np.sqrt(dx * dx + dy * dy)
                falls = rises = (extreme >= 0.0) != before
        for sense in (1, -1):
            if falls if sense > 0 else rises:
                touching[number, 0], touching[number, 1] = a, b
                touching[number, 2] = sense
                touching[number, 3] = sense if side > 0.0 else -sense
                number += 1
        if is_first:
            a, place = next_a, place + 1
        else:
            b, other_place = next_b, other_place + 1
    return number


@compiled
def _turned(angle: float, side: float) -> float:
    """The angle of a normal of the second obstacle, or of its mirror image, in [0, 2 pi)."""
    if side > 0.0:
        return angle
    return angle - _HALF_TURN if angle >= _HALF_TURN else angle + _HALF_TURN
