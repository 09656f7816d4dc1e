"""Where the boundaries of obstacles are covered by others or lie outside the bounds, compiled.

Walls are points in the middle of arcs and edges that are covered. One on each connected part that
is covered is enough.
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Integers,
    Shapes,
    end_of,
    enters,
    is_disc,
    last_corner,
    nearest_feature,
    wall_on_edge,
)


@compiled
def walls(scene: Scene) -> tuple[Integers, Array]:
    """Obstacles, and counter-clockwise angles at which their boundaries are covered."""
    scene = unowned(scene)  # the caller holds it
    where, angles = [0 for _ in range(0)], [0.0 for _ in range(0)]
    discs, box, shapes = scene.discs, scene.box, scene.shapes
    only_discs = len(shapes.first) == 0
    for i in range(len(discs)):
        x, y, radius = discs[i].x, discs[i].y, discs[i].radius
        right, top, left, bottom = x + radius, y + radius, x - radius, y - radius
        if not (only_discs or is_disc(shapes, i)):
            right, top, left, bottom = _extent(shapes, i)
        beyond = (right > box[1, 0], top > box[1, 1], left < box[0, 0], bottom < box[0, 1])
        for side in range(4):
            if beyond[side]:
                where.append(i)
                angles.append(side * TWO_PI / 4.0)
        for j in range(len(discs)):
            dx, dy = discs[j].x - x, discs[j].y - y
            apart = np.sqrt(dx * dx + dy * dy)
            if only_discs or (is_disc(shapes, i) and is_disc(shapes, j)):
                # the boundary's point nearest to the other centre
                if j != i and abs(apart - radius) < discs[j].reach:
                    where.append(i)
                    angles.append(math.atan2(dy, dx))
            elif j != i and apart < radius + discs[j].reach:
                _add_covered(shapes, i, j, discs[j].x, discs[j].y, discs[j].radius, angles)
            while len(where) < len(angles):
                where.append(i)
    return np.array(where), np.array(angles)


@compiled
def _extent(shapes: Shapes, i: int) -> tuple[float, float, float, float]:
    """Greatest x and y, and least x and y, of obstacle i [m]."""
    right, top, left, bottom = -np.inf, -np.inf, np.inf, np.inf
    for c in range(shapes.first[i], shapes.first[i + 1]):
        corner = shapes.corners[c]
        right, top = max(right, corner.x), max(top, corner.y)
        left, bottom = min(left, corner.x), min(bottom, corner.y)
    radius = shapes.radii[i]
    return right + radius, top + radius, left - radius, bottom - radius


@compiled
def _add_covered(
    shapes: Shapes, i: int, j: int, x: float, y: float, reach: float, angles: list[float]
) -> None:
    """Append an angle for each part of the boundary of obstacle i that obstacle j covers.

    Obstacle j lies within a distance `reach` of (x, y) [m].
    """
    radius = shapes.radii[i]
    for c in range(shapes.first[i], shapes.first[i + 1]):
        corner = shapes.corners[c]
        dx, dy = corner.x - x, corner.y - y
        if not is_disc(shapes, i):
            # from the middle of the edge
            half = 0.5 * corner.size
            beside = dx * corner.nx + dy * corner.ny + radius
            along = dy * corner.nx - dx * corner.ny - half
            if beside * beside + along * along < (half + reach) ** 2:
                before = shapes.corners[last_corner(shapes, i, c)]
                start_x, start_y = before.x + radius * corner.nx, before.y + radius * corner.ny
                if enters(start_x, start_y, -corner.ny, corner.nx, corner.size, shapes, j):
                    angles.append(wall_on_edge(shapes, c))
        if radius > 0.0 and dx * dx + dy * dy < (reach + radius) ** 2:
            depth = nearest_feature(shapes, j, corner.x, corner.y).distance - shapes.reach[j]
            # where all of an arc is covered, so are the edges beside it
            if -radius < depth < radius:
                _add_covered_arcs(shapes, i, c, j, angles)


@compiled
def _add_covered_arcs(shapes: Shapes, i: int, corner: int, j: int, angles: list[float]) -> None:
    """Append an angle for each part of a corner's arc that obstacle j covers.

    Between two angles where the circle may meet the other boundary it is covered or not.
    """
    center, radius, reach = shapes.corners[corner], shapes.radii[i], shapes.reach[j]
    begin, wide = center.begin, TWO_PI
    if not is_disc(shapes, i):
        wide = (end_of(shapes, i, corner) - begin) % TWO_PI
    meets = [0.0, wide]
    for c in range(shapes.first[j], shapes.first[j + 1]):
        other = shapes.corners[c]
        dx, dy = other.x - center.x, other.y - center.y
        if not is_disc(shapes, j):
            # the edge's line, moved out by the reach
            share = (dx * other.nx + dy * other.ny + reach) / radius
            if abs(share) < 1.0:
                _add_meets(math.atan2(other.ny, other.nx), math.acos(share), begin, wide, meets)
        apart = np.sqrt(dx * dx + dy * dy)
        if reach > 0.0 and abs(radius - reach) < apart < radius + reach:
            share = (apart * apart + radius * radius - reach * reach) / (2.0 * apart * radius)
            if abs(share) < 1.0:
                _add_meets(math.atan2(dy, dx), math.acos(share), begin, wide, meets)
    meets.sort()
    for k in range(len(meets) - 1):
        if meets[k + 1] > meets[k]:
            at = begin + 0.5 * (meets[k] + meets[k + 1])
            x, y = center.x + radius * math.cos(at), center.y + radius * math.sin(at)
            if nearest_feature(shapes, j, x, y).distance < reach:
                angles.append(at)


@compiled
def _add_meets(middle: float, half: float, begin: float, wide: float, meets: list[float]) -> None:
    """Append the two ends of a range around an angle, as angles from `begin`, if within a range."""
    for end in (middle - half, middle + half):
        at = (end - begin) % TWO_PI
        if at < wide:
            meets.append(at)
