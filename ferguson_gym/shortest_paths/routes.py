"""Routes along lines and discs as a search extends them, line by line, and whether they loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.shapes import (
    TWO_PI,
    Records,
    Shapes,
    corner_at,
    end_of,
    is_disc,
    sweep,
)

MIN_SWEEP = 1e-7
"""Arcs shorter than this angle [rad] count as touching; arcs within this angle of a full turn count
as loops."""


class Stage(NamedTuple):
    """A route up to the end of one of its lines."""

    parent: int
    """The preceding stage, -1 for the first line."""
    track: int
    """The track that is reached, STRAIGHT at the goal."""
    at: float
    """Angle at which it is reached [rad]."""
    turn: float
    """Sweep along the parent's track before the line [rad]."""
    length: float
    """Length of the route so far [m]."""
    x: float
    """Start of the line [m]."""
    y: float
    end_x: float
    """End of the line [m]."""
    end_y: float


@compiled
def _line_length(stage: Stage) -> float:
    """Length of a stage's line [m]."""
    long: float = np.hypot(stage.end_x - stage.x, stage.end_y - stage.y)
    return long


@compiled
def _separated(one: Stage, other: Stage, least: float) -> bool:
    """Whether the ends of one line lie on different sides of another, `least` [m] away or more."""
    dx, dy = other.end_x - other.x, other.end_y - other.y
    least *= _line_length(other)
    start = dx * (one.y - other.y) - dy * (one.x - other.x)
    end = dx * (one.end_y - other.y) - dy * (one.end_x - other.x)
    separated: bool = min(start, end) < -least and max(start, end) > least
    return separated


@compiled
def _meet(one: Stage, other: Stage, most: float) -> bool:
    """Whether two lines cross or, but for `most` [m], touch."""
    return not _beside(one, other, most) and not _beside(other, one, most)


@compiled
def _beside(one: Stage, other: Stage, least: float) -> bool:
    """Whether all of one line lies on one side of another, `least` [m] away or more."""
    dx, dy = other.end_x - other.x, other.end_y - other.y
    least *= _line_length(other)
    start = dx * (one.y - other.y) - dy * (one.x - other.x)
    end = dx * (one.end_y - other.y) - dy * (one.end_x - other.x)
    beside: bool = max(start, end) < -least or min(start, end) > least
    return beside


@compiled
def has_loop(
    stages: list[Stage], index: int, discs: Records, shapes: Shapes, margin: float
) -> bool:
    """Whether a stage's last arc or line meets an earlier part of its route."""
    last = stages[index]
    if last.parent < 0:
        return False
    arc = stages[last.parent]
    least = 1e-3 * margin  # lines that touch do not cross
    if is_disc(shapes, arc.track // 2):
        # beyond half a turn, the tangents at an arc's ends meet in front of the disc
        ahead = discs[arc.track // 2].radius * math.tan(0.5 * (TWO_PI - last.turn))
        if last.turn > 0.5 * TWO_PI and min(_line_length(last), _line_length(arc)) > ahead:
            return True
    elif last.turn > 0.5 * TWO_PI and (
        _meet(last, arc, margin) or _widened(shapes, margin, arc, last.turn)[1] >= TWO_PI
    ):
        return True
    before, turn = arc.parent, arc.turn
    while before >= 0:
        stage = stages[before]
        if _separated(last, stage, least) and _separated(stage, last, least):
            return True
        # this stage's track is left after `turn`
        if stage.track == arc.track and (
            sweep(stage.at, arc.at) <= turn or sweep(arc.at, stage.at) <= last.turn
        ):
            return True
        # classes among discs alone are on record with paths that go back by the way they came
        if len(shapes.first) > 0 and (
            _is_back(last, stage, margin)
            or _is_back_along(shapes, margin, arc, last.turn, stage, turn)
        ):
            return True
        before, turn = stage.parent, stage.turn
    return False


@compiled
def _is_back(one: Stage, other: Stage, margin: float) -> bool:
    """Whether one line is another one in reverse."""
    apart = abs(one.x - other.end_x) + abs(one.y - other.end_y)
    apart += abs(one.end_x - other.x) + abs(one.end_y - other.y)
    back: bool = apart <= margin < _line_length(one)
    return back


@compiled
def _is_back_along(
    shapes: Shapes, margin: float, arc: Stage, turn: float, other: Stage, other_turn: float
) -> bool:
    """Whether an arc follows a part of another one in reverse, or comes back to a sharp corner."""
    if arc.track // 2 != other.track // 2:
        return False
    at, turn = _widened(shapes, margin, arc, turn)
    begin, other_turn = _widened(shapes, margin, other, other_turn)
    if arc.track != other.track:
        begin = -(begin + other_turn) % TWO_PI
    return sweep(begin, at) < other_turn - MIN_SWEEP or sweep(at, begin) < turn - MIN_SWEEP


@compiled
def _widened(shapes: Shapes, margin: float, arc: Stage, turn: float) -> tuple[float, float]:
    """Where an arc begins, and its sweep [rad]; with the whole of corners without a radius."""
    i = arc.track // 2
    if is_disc(shapes, i) or shapes.radii[i] > margin:
        return arc.at, turn
    begin, until = arc.at, (arc.at + turn) % TWO_PI
    if arc.track % 2 == 1:
        begin, until = TWO_PI - until, TWO_PI - begin
    low = shapes.corners[corner_at(shapes, i, begin)].begin
    high = end_of(shapes, i, corner_at(shapes, i, until))
    wide = turn + (begin - low) % TWO_PI + (high - until) % TWO_PI
    return (-high % TWO_PI if arc.track % 2 == 1 else low), wide
