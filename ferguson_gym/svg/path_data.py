"""Curves as SVG path data, in whole units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array

Whole = NDArray[np.int64]


def chain_data(control: Array) -> str:
    """Segments (n, 4, 2) that join with one tangent as path data; empty without segments.

    A Ferguson segment is the Bézier curve with control points a third of its derivatives from
    its ends; as neighbours share their derivatives, each after the first is a smooth curve.
    """
    if len(control) == 0:
        return ""
    start, end, departure, arrival = np.moveaxis(np.asarray(control), 1, 0)
    points = whole(np.vstack([start[:1], end]))
    before = whole(end - arrival / 3.0) - points[:-1]
    steps = np.diff(points, axis=0)
    first = whole(start[0] + departure[0] / 3.0) - points[0]
    parts = [f"M{pair(points[0])}c{pair(first)} {pair(before[0])} {pair(steps[0])}"]
    rest = zip(before[1:], steps[1:], strict=True)
    parts.extend(f"s{pair(middle)} {pair(step)}" for middle, step in rest)
    return "".join(parts)


def polyline_data(points: Array) -> str:
    """Points (n, 2) joined by straight lines as path data; empty without points."""
    if len(points) == 0:
        return ""
    corners = whole(points)
    steps = np.diff(corners, axis=0)
    return f"M{pair(corners[0])}" + "".join(f"l{pair(step)}" for step in steps)


def outline_data(arcs: Array, radius: float) -> str:
    """A closed line of arcs (k, 2, 2), each below half a turn, joined by lines, as path data.

    Args:
        arcs: start and end of each arc.
        radius: of all arcs; 0 where the lines meet in corners.
    """
    ends, size = whole(arcs), round(radius)
    steps = np.diff(ends.reshape(-1, 2), axis=0)
    x, y = arcs[:, 0].T
    positive = int(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0)
    parts = [f"M{pair(ends[0, 0])}"]
    for k, step in enumerate(steps):
        if step.any():
            arc = size > 0 and k % 2 == 0
            parts.append((f"a{size} {size} 0 0 {positive} " if arc else "l") + pair(step))
    return "".join(parts) + "z"


def whole(values: Array) -> Whole:
    """Numbers rounded to whole units."""
    return np.rint(np.asarray(values)).astype(np.int64)


def pair(point: Sequence[int] | Whole) -> str:
    """Two whole numbers, separated by as little as SVG needs."""
    # a minus sign separates numbers as well as a space does
    return f"{point[0]} {point[1]}".replace(" -", "-")
