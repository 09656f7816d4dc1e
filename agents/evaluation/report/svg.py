"""Drawings of fields and paths in the report: SVG path data, rounded to centimetres."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import ShortestPath, shortest_path
from ferguson_gym.world import Discs, field_names
from ferguson_gym.world.field import BOUNDS, Field


def draw_chain(control: Array) -> str:
    """Segments (n, 4, 2) as SVG path data in centimetres, y upwards; empty without segments.

    A Ferguson segment is the Bézier curve with control points a third of its derivatives from
    its ends; as neighbours share their derivatives, each after the first is a smooth curve.
    """
    if len(control) == 0:
        return ""
    start, end, departure, arrival = np.moveaxis(np.asarray(control), 1, 0)
    points = _centimetres(np.vstack([start[:1], end]))
    before = _centimetres(end - arrival / 3.0) - points[:-1]
    steps = np.diff(points, axis=0)
    first = _centimetres(start[0] + departure[0] / 3.0) - points[0]
    parts = [f"M{_pair(points[0])}c{_pair(first)} {_pair(before[0])} {_pair(steps[0])}"]
    rest = zip(before[1:], steps[1:], strict=True)
    parts.extend(f"s{_pair(middle)} {_pair(step)}" for middle, step in rest)
    return "".join(parts)


def draw_shortest(path: ShortestPath) -> str:
    """Lines and arcs as SVG path data in centimetres, y upwards."""
    lines = _centimetres(path.lines)
    radii = _centimetres(path.radii)
    parts = [f"M{_pair(lines[0, 0])}L{_pair(lines[0, 1])}"]
    for k, sweep in enumerate(path.sweeps):
        large, left = int(sweep > math.pi), int(path.senses[k] > 0)
        parts.append(f"A{radii[k]} {radii[k]} 0 {large} {left} {_pair(lines[k + 1, 0])}")
        parts.append(f"L{_pair(lines[k + 1, 1])}")
    return "".join(parts)


def draw_field(name: str, fields: Mapping[str, Field]) -> dict[str, Any]:
    """Bounds, start, goal, discs and shortest path of a field, as far as they are known.

    A field that is not in `fields` is drawn if its name defines it.
    """
    field = fields[name] if name in fields else _named(name)
    drawn: dict[str, Any] = {"name": name, "bounds": _centimetres(np.repeat(BOUNDS, 2)).tolist()}
    drawn |= dict.fromkeys(("start", "goal", "discs", "shortest"))
    if field is None or len(field.start) != 2:
        return drawn
    drawn["bounds"] = _centimetres(field.bounds).ravel().tolist()
    drawn["start"], drawn["goal"] = (_centimetres(p).tolist() for p in (field.start, field.goal))
    if isinstance(field.obstacles, Discs):
        discs = np.column_stack([field.obstacles.centers, field.obstacles.radii])
        drawn["discs"] = _centimetres(discs).ravel().tolist()
        shortest = shortest_path(field)
        drawn["shortest"] = None if shortest is None else draw_shortest(shortest)
    return drawn


def _named(name: str) -> Field | None:
    """The field that a name defines; None for a file's name, since the file may have changed."""
    try:
        field_names.family(name)
        return field_names.get_field(name)
    except ValueError:
        return None


def _centimetres(metres: Array) -> NDArray[np.int64]:
    return np.rint(100.0 * np.asarray(metres)).astype(np.int64)


def _pair(point: Sequence[int] | NDArray[np.int64]) -> str:
    # a minus sign separates numbers as well as a space does
    return f"{point[0]} {point[1]}".replace(" -", "-")
