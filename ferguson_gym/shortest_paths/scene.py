"""The obstacles that can obstruct a path, and which of them lie in a line's way.

One margin separates free from blocked, 1e-9 of the field's size (1e-7 m in the paper's fields): a
line or arc may cut into an obstacle or leave the bounds by that much. A path can therefore pass
between two obstacles that touch, or that overlap by no more than the margin, and through any
passage, however narrow. Obstacles smaller than the margin are ignored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Integers,
    Records,
    Shapes,
    enters,
    make_shapes,
    nearest_feature,
    no_shapes,
    only_these,
)
from ferguson_gym.world.field import Field

MARGIN = 1e-9
"""Depth by which a path may enter obstacles or leave the bounds, relative to the field's size."""

DISC = np.dtype(
    [
        ("x", np.float64),  # centre [m]
        ("y", np.float64),
        ("radius", np.float64),  # [m]
        ("reach", np.float64),  # distance from the centre below which a point counts as inside [m]
    ]
)


class Scene(NamedTuple):
    """The obstacles that can obstruct a path: not those within others or outside the bounds."""

    discs: Records
    """(n,) of DISC; their reach is the radius less the margin. For an obstacle of another shape,
    the disc that bounds it."""
    box: Array
    """(2, 2) lower and upper bounds of the coordinates, enlarged by the margin [m]."""
    margin: float
    """[m]."""
    shapes: Shapes
    """What the discs bound; empty where every obstacle is a disc."""


class View(NamedTuple):
    """Obstacles in the order of their bounding discs' distance from a point."""

    order: Integers
    """(n,) obstacles."""
    near: Array
    """(n,) distance of each bounding disc from the point [m], increasing."""


def scene(field: Field) -> tuple[Scene, Integers]:
    """The obstacles of a field that can obstruct a path, and their indices in the field.

    Raises:
        TypeError: a field that is not planar.
    """
    obstacles = field.obstacles
    if obstacles.dimension != 2:
        raise TypeError(
            f"shortest paths are found in the plane, got {obstacles.dimension} dimensions"
        )
    low, high = field.bounds
    centers, radii = obstacles.balls
    far = np.abs(centers).max(axis=1) + radii if len(obstacles) else np.zeros(1)
    # the second term is rounding, which matters for obstacles that are huge beside the field
    margin = MARGIN * float((high - low).max()) + 1e-14 * float(
        max(far.max(), np.abs(field.bounds).max())
    )
    shapes = no_shapes()
    if obstacles.are_discs:
        order = np.argsort(-radii, kind="stable")
        kept = np.flatnonzero(_matters(centers, radii, order, low, high, margin))
    else:
        shapes = make_shapes(obstacles.points, obstacles.starts, obstacles.radii, margin)
        kept = np.flatnonzero(_shape_matters(centers, radii, shapes, low, high, margin))
        shapes = only_these(shapes, kept)
    records = np.empty(len(kept), dtype=DISC)
    records["x"], records["y"] = centers[kept].T
    records["radius"] = radii[kept]
    records["reach"] = radii[kept] - margin
    return Scene(records, np.stack([low - margin, high + margin]), margin, shapes), kept


@compiled
def _shape_matters(
    centers: Array, radii: Array, shapes: Shapes, low: Array, high: Array, margin: float
) -> NDArray[np.bool_]:
    """Whether an obstacle may reach into the bounds and is not contained in another one.

    Of obstacles that are the same, the first one matters.
    """
    count = len(radii)
    matters, perimeter = np.zeros(count, dtype=np.bool_), np.empty(count)
    for i in range(count):
        # greater than that of every convex set within
        perimeter[i] = TWO_PI * shapes.radii[i]
        if shapes.first[i + 1] - shapes.first[i] > 1:
            perimeter[i] += shapes.corners[shapes.first[i + 1] - 1].along
    for i in np.argsort(-perimeter, kind="mergesort"):
        x, y, first, end = centers[i, 0], centers[i, 1], shapes.first[i], shapes.first[i + 1]
        beyond_x = max(low[0] - x, x - high[0], 0.0)
        beyond_y = max(low[1] - y, y - high[1], 0.0)
        is_thin = end - first < 3 and not shapes.radii[i] > margin
        matters[i] = not is_thin and np.hypot(beyond_x, beyond_y) < radii[i]
        for k in range(count):
            if not matters[i]:
                break
            dx, dy = centers[k, 0] - x, centers[k, 1] - y
            if k == i or not matters[k] or dx * dx + dy * dy > radii[k] * radii[k]:
                continue
            within = True
            for c in range(first, end):
                corner = shapes.corners[c]
                reach = shapes.radii[k] + margin - shapes.radii[i]
                within = within and nearest_feature(shapes, k, corner.x, corner.y).distance <= reach
            matters[i] = not within
    return matters


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


@compiled_in_place
def comes_within(dx: float, dy: float, reach: float, ux: float, uy: float, length: float) -> bool:
    """Whether a line in a unit direction comes within the reach of a disc at (dx, dy) from it."""
    beside, within = dx * uy - dy * ux, False
    if abs(beside) < reach:
        along = dx * ux + dy * uy
        beyond = -along if along < 0.0 else max(along - length, 0.0)
        within = beside * beside + beyond * beyond < reach * reach
    return within


@compiled
def is_clear(
    x: float,
    y: float,
    ux: float,
    uy: float,
    length: float,
    far: float,
    scene: Scene,
    view: View,
    one: int,
    other: int,
) -> bool:
    """Whether a line from (x, y) in a unit direction meets no obstacle except `one` and `other`.

    The line touches these two; -1 stands for none. All points of the line must lie within `far` [m]
    of the point for which `view` was computed.
    """
    discs, shapes = scene.discs, scene.shapes
    for place in range(len(discs)):
        if view.near[place] >= far:
            break
        k = view.order[place]
        if k in (one, other):
            continue
        if comes_within(discs[k].x - x, discs[k].y - y, discs[k].reach, ux, uy, length):
            if len(shapes.first) == 0 or shapes.first[k + 1] - shapes.first[k] == 1:
                return False
            if enters(x, y, ux, uy, length, shapes, k):
                return False
    return True


@compiled
def discs_within(scene: Scene) -> Records:
    """Discs (n,) of DISC within the obstacles, the deepest about their middles.

    A line that comes within the reach of one enters the obstacle. A disc is its own.
    """
    shapes, within = scene.shapes, scene.discs.copy()
    for k in range(len(shapes.first) - 1):
        first, end = shapes.first[k], shapes.first[k + 1]
        if end - first == 1:
            continue
        x, y = 0.0, 0.0
        for c in range(first, end):
            x, y = x + shapes.corners[c].x / (end - first), y + shapes.corners[c].y / (end - first)
        depth = shapes.reach[k] - nearest_feature(shapes, k, x, y).distance
        within[k].x, within[k].y = x, y
        within[k].radius, within[k].reach = depth, depth - scene.margin
    return within
