"""The recipe of suite `walls`: rooms and corridors between long thin walls with doors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise, starmap
from typing import NamedTuple

import numpy as np

from ferguson_gym.world.field import BOUNDS, GOAL, START
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.recipes.uniform_numbers import uniform_numbers

MOST = 96
"""Upper limit of the obstacles of a field; what is drawn beyond it is left out."""
_ROOM = 7.0
"""Least distance of walls from start and goal, and from the middles of other walls' doors [m]."""
_NARROWEST = 9.0
"""Least distance between the ends of neighbouring walls [m]."""
_LEAN = 0.25
"""Upper limit of the slope of a wall to its neighbours."""
_LONGEST_WAY = 185.0
"""Upper limit of the length of one way from start to goal, straight from door to door [m]."""

_Point = tuple[float, float]


class _Room(NamedTuple):
    """Corners of a convex quadrilateral, counter-clockwise [m]."""

    a: _Point
    b: _Point
    c: _Point
    d: _Point


class _Wall(NamedTuple):
    """A wall through a room, from its side ab to its side dc [m]."""

    p: _Point
    q: _Point
    room: _Room


class _House:
    """A square divided by walls."""

    def __init__(self, draws: Iterator[float]) -> None:
        self.draws = draws
        self.free: list[_Point] = [START, GOAL]
        """Start, goal and middles of doors [m]."""
        self.way: list[_Point] = [START, GOAL]
        """A way from start to goal through doors, each leg of which lies in one room [m]."""

    def pieces(self) -> Iterator[tuple[_Point, _Point]]:
        """Both ends of each piece of a wall beside its doors."""
        low, high = BOUNDS
        rooms = [_Room((low, low), (high, low), (high, high), (low, high))]
        while rooms:
            if (wall := self._wall(rooms.pop())) is not None:
                p, q, (a, b, c, d) = wall
                yield from self._with_doors(p, q)
                rooms += [_Room(a, p, q, d), _Room(p, b, c, q)]

    def _wall(self, room: _Room) -> _Wall | None:
        """A wall that divides a room, unless it is small or no such wall is found."""
        draws, (a, b, c, d) = self.draws, room
        width = 0.5 * (_distance(a, b) + _distance(c, d))
        depth = 0.5 * (_distance(b, c) + _distance(d, a))
        if width * depth < 400.0 + 700.0 * next(draws):
            return None
        # mostly across the longer direction; walls along it make corridors
        across = (next(draws) < 0.8) == (width > depth)
        return self._wall_across(room if across else _Room(b, c, d, a)) or self._wall_across(
            _Room(b, c, d, a) if across else room
        )

    def _wall_across(self, room: _Room) -> _Wall | None:
        """A wall from side ab to side dc that leaves room at start, goal and doors, if found."""
        draws, (a, b, c, d) = self.draws, room
        near, far = _distance(a, b), _distance(c, d)
        if (width := min(near, far)) < 2.0 * _NARROWEST:
            return None
        steepest = _LEAN * min(_distance(b, c), _distance(d, a)) / width
        for _ in range(6):
            middle, lean = next(draws), steepest * (next(draws) - 0.5)
            p = _between(a, b, _inside(middle + lean, near))
            q = _between(d, c, _inside(middle - lean, far))
            if _leaves_room(p, q, self.free):
                return _Wall(p, q, room)
        return None

    def _with_doors(self, p: _Point, q: _Point) -> list[tuple[_Point, _Point]]:
        """The pieces of a wall beside its doors, which are added to the others."""
        draws, length = self.draws, _distance(p, q)
        half = 0.5 * (6.5 + 2.5 * next(draws)) / length
        middles = [self._way_through(p, q, half)]
        if length > 50.0 and next(draws) < 0.7:
            middles.append(half + (1.0 - 2.0 * half) * next(draws))
        self.free += [_between(p, q, middle) for middle in middles]
        pieces, begin = [], 0.0
        for middle in [*sorted(middles), 1.0 + half]:
            if (middle - half - begin) * length > 1.5:
                pieces.append((_between(p, q, begin), _between(p, q, middle - half)))
            begin = max(begin, middle + half)
        return pieces

    def _way_through(self, p: _Point, q: _Point, half: float) -> float:
        """Share of a wall at which a door is, on the way if the wall is in its way."""
        draws, way = self.draws, self.way
        for k, (begin, end) in enumerate(pairwise(way)):
            if (crossing := _crossing(p, q, begin, end)) is None:
                continue
            rest = math.fsum(starmap(_distance, pairwise(way))) - _distance(begin, end)
            for _ in range(6):
                share = half + (1.0 - 2.0 * half) * next(draws)
                door = _between(p, q, share)
                if rest + _distance(begin, door) + _distance(door, end) <= _LONGEST_WAY:
                    break
            else:
                share = min(max(crossing, half), 1.0 - half)
                door = _between(p, q, share)
            way.insert(k + 1, door)
            return share
        return half + (1.0 - 2.0 * half) * next(draws)


def walls(stream: np.random.RandomState) -> Obstacles:
    """Rooms and corridors: walls 0.6 to 1.4 m thick, with doors at least 5 m wide.

    The field is divided by a wall from one side to the opposite one, straight but askew, then the
    rooms on both sides of it, until rooms are small. Every wall has a door, most long ones have
    two: each place can be reached, many by several ways, and rooms with one door are dead ends. One
    way from start to goal through doors is at most 185 m long, between their middles.
    """
    draws = uniform_numbers(stream)
    pieces = list(_House(draws).pieces())[:MOST]
    return Obstacles.capsules(pieces, 0.3 + 0.4 * np.array([next(draws) for _ in pieces]))


def _inside(share: float, length: float) -> float:
    """A share of a side's length that is far enough from its ends."""
    edge = _NARROWEST / length
    return edge + (1.0 - 2.0 * edge) * min(max(share, 0.0), 1.0)


def _between(p: _Point, q: _Point, share: float) -> _Point:
    return p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])


def _distance(p: _Point, q: _Point) -> float:
    x, y = q[0] - p[0], q[1] - p[1]
    return math.sqrt(x * x + y * y)  # the same on every machine, which `hypot` is not


def _leaves_room(p: _Point, q: _Point, points: list[_Point]) -> bool:
    """Whether a wall keeps its distance from all of these points."""
    x, y, room = q[0] - p[0], q[1] - p[1], _ROOM * _ROOM
    square = x * x + y * y
    for point in points:
        u, v = point[0] - p[0], point[1] - p[1]
        along, aside = u * x + v * y, u * y - v * x
        if along < 0.0:
            is_near = u * u + v * v < room
        elif along > square:
            u, v = u - x, v - y
            is_near = u * u + v * v < room
        else:
            is_near = aside * aside < room * square
        if is_near:
            return False
    return True


def _crossing(p: _Point, q: _Point, begin: _Point, end: _Point) -> float | None:
    """Share of the line pq at which another line crosses it, if it does."""
    x, y = end[0] - begin[0], end[1] - begin[1]
    of_p = x * (p[1] - begin[1]) - y * (p[0] - begin[0])
    of_q = x * (q[1] - begin[1]) - y * (q[0] - begin[0])
    u, v = q[0] - p[0], q[1] - p[1]
    of_begin = u * (begin[1] - p[1]) - v * (begin[0] - p[0])
    of_end = u * (end[1] - p[1]) - v * (end[0] - p[0])
    if of_p * of_q >= 0.0 or of_begin * of_end >= 0.0:
        return None
    return of_p / (of_p - of_q)
