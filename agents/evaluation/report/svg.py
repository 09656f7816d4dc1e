"""Drawings of fields and paths in the report: SVG path data, rounded to centimetres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from agents.flights.field_changes import FieldChanges
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import ShortestPath, shortest_path
from ferguson_gym.svg.outline import outline
from ferguson_gym.svg.path_data import Whole, chain_data, outline_data, pair, whole
from ferguson_gym.world import Obstacles, field_names
from ferguson_gym.world.field import BOUNDS, Field


def draw_chain(control: Array) -> str:
    """Segments (n, 4, 2) as SVG path data in centimetres, y upwards; empty without segments."""
    return chain_data(100.0 * np.asarray(control))


def draw_shortest(path: ShortestPath) -> str:
    """Lines and arcs as SVG path data in centimetres, y upwards."""
    lines = _centimetres(path.lines)
    radii = _centimetres(path.radii)
    parts = [f"M{pair(lines[0, 0])}L{pair(lines[0, 1])}"]
    for k, sweep in enumerate(path.sweeps):
        large, left = int(sweep > math.pi), int(path.senses[k] > 0)
        parts.append(f"A{radii[k]} {radii[k]} 0 {large} {left} {pair(lines[k + 1, 0])}")
        parts.append(f"L{pair(lines[k + 1, 1])}")
    return "".join(parts)


def draw_field(name: str, fields: Mapping[str, Field], changes: FieldChanges) -> dict[str, Any]:
    """Bounds, start, goal, obstacles and shortest path of a changed field, as far as known.

    A field that is not in `fields` is drawn if its name defines it. Of obstacles that are not all
    discs, `shapes` is the path data.
    """
    field = fields[name] if name in fields else _named(name)
    field = None if field is None else changes.apply(field)
    drawn: dict[str, Any] = {"name": name, "bounds": _centimetres(np.repeat(BOUNDS, 2)).tolist()}
    drawn |= dict.fromkeys(("start", "goal", "discs", "shortest"))
    if field is None or len(field.start) != 2:
        return drawn
    drawn["bounds"] = _centimetres(field.bounds).ravel().tolist()
    drawn["start"], drawn["goal"] = (_centimetres(p).tolist() for p in (field.start, field.goal))
    drawn |= draw_obstacles(field.obstacles)
    shortest = shortest_path(field)
    drawn["shortest"] = None if shortest is None else draw_shortest(shortest)
    return drawn


def draw_obstacles(obstacles: Obstacles) -> dict[str, Any]:
    """Discs as `discs`, three numbers each [cm], and all others as the path data `shapes`."""
    discs = np.diff(obstacles.starts) == 1
    centers, radii = obstacles.points[obstacles.starts[:-1][discs]], obstacles.radii[discs]
    drawn: dict[str, Any] = {
        "discs": _centimetres(np.column_stack([centers, radii])).ravel().tolist()
    }
    if others := np.flatnonzero(~discs).tolist():
        outlines = [outline(obstacles.core(k), float(obstacles.radii[k])) for k in others]
        drawn["shapes"] = "".join(
            outline_data(100.0 * one.arcs, 100.0 * one.radius) for one in outlines
        )
    return drawn


def _named(name: str) -> Field | None:
    """The field that a name defines; None for a file's name, since the file may have changed."""
    try:
        field_names.family(name)
        return field_names.get_field(name)
    except ValueError:
        return None


def _centimetres(metres: Array) -> Whole:
    return whole(100.0 * np.asarray(metres))
