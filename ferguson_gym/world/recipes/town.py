"""The recipe of suite `town`: buildings and trees in blocks between straight streets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import GOAL, START
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.recipes.uniform_numbers import uniform_numbers

MOST = 96
"""Upper limit of the obstacles of a field; what is drawn beyond it is left out."""
_LOW, _HIGH = -4.0, 104.0
"""Everything lies between these coordinates [m]: a street of 6 m leads around the town."""
_ROOM = 6.0
"""Free radius around start and goal [m]."""
_MIDDLE = 50.0
"""Coordinates of the middle of the town [m]."""
_NumberOrArray = TypeVar("_NumberOrArray", float, Array)


class _Shape(NamedTuple):
    """A rectangle grown by a radius, in coordinates along the streets [m]; a tree has no sides."""

    x: float
    y: float
    half_width: float
    half_depth: float
    radius: float = 0.0
    slope: float = 0.0
    """Tangent of half the angle by which it is turned about its middle."""


def town(stream: np.random.RandomState) -> Obstacles:
    """A town: rectangular, rounded and L-shaped buildings, and trees, in blocks between streets.

    A square, turned by up to 27 degrees, is cut by streets until the blocks between them are small:
    the first streets lead through the whole town, later ones end at others. Streets are 5 to 9 m
    wide, and what is built in a block stays inside it.
    """
    draws = uniform_numbers(stream)
    cosine, sine = _direction(0.48 * next(draws) - 0.24)
    half = 0.5 * (_HIGH - _LOW) * (cosine + abs(sine))
    shapes = np.array(
        [
            shape
            for block in _blocks(draws, _Shape(0.0, 0.0, half, half), 0)
            for shape in _built(draws, block)
        ]
    )
    x, y = _turned(_corners(shapes), cosine, sine)
    corners, radii = _MIDDLE + np.stack([x, y], axis=-1), shapes[:, 4]
    # the leftmost corner comes first, as in fields that are read from files
    order = (corners[..., 0].argmin(axis=1)[:, None] + np.arange(4)) % 4
    corners = np.take_along_axis(corners, order[..., None], axis=1)
    reach = radii[:, None]
    inside = (corners.min(axis=1) - reach >= _LOW) & (corners.max(axis=1) + reach <= _HIGH)
    one_corner = shapes[:, 2] == 0.0
    first = np.concatenate([[0], np.cumsum(np.where(one_corner, 1, 4))])
    points = corners[~one_corner[:, None] | (np.arange(4) == 0)]
    every = Obstacles(points, radii, first)
    room = every.signed_distance(np.array([START, GOAL])).min(axis=0) >= _ROOM
    return every.only_these(np.flatnonzero(inside.all(axis=1) & room)[:MOST])


def _direction(slope: _NumberOrArray) -> tuple[_NumberOrArray, _NumberOrArray]:
    """Cosine and sine of an angle from the tangent of its half.

    They are the same on every machine, which those of C libraries are not.
    """
    square = slope * slope
    return (1.0 - square) / (1.0 + square), 2.0 * slope / (1.0 + square)


def _turned(
    points: tuple[Array, Array], cosine: float | Array, sine: float | Array
) -> tuple[Array, Array]:
    x, y = points
    return cosine * x - sine * y, sine * x + cosine * y


def _corners(shapes: Array) -> tuple[Array, Array]:
    """Coordinates, each (n, 4), of the corners of shapes, counter-clockwise."""
    x, y, half_width, half_depth, _, slope = shapes.T[..., None]
    ring = half_width * [-1.0, 1.0, 1.0, -1.0], half_depth * [-1.0, -1.0, 1.0, 1.0]
    along, across = _turned(ring, *_direction(slope))
    return x + along, y + across


def _blocks(draws: Iterator[float], area: _Shape, level: int) -> Iterator[_Shape]:
    """The blocks that streets leave of an area."""
    if 2.0 * max(area.half_width, area.half_depth) < 18.0 + 13.0 * next(draws):
        yield area
        return
    street = 7.0 + 2.0 * next(draws) if level < 2 else 5.0 + 2.0 * next(draws)
    for part in _halves(area, street, 0.36 + 0.28 * next(draws)):
        yield from _blocks(draws, part, level + 1)


def _halves(area: _Shape, gap: float, share: float) -> tuple[_Shape, _Shape]:
    """Both parts of an area, cut across its longer side; the first has this share of the rest."""
    x, y, p, q, *_ = area
    near = share * (max(p, q) - 0.5 * gap)
    far = max(p, q) - 0.5 * gap - near
    if p > q:
        return _Shape(x - p + near, y, near, q), _Shape(x + p - far, y, far, q)
    return _Shape(x, y - q + near, p, near), _Shape(x, y + q - far, p, far)


def _built(draws: Iterator[float], block: _Shape) -> list[_Shape]:
    """What is built in a block, or the trees there."""
    kind, first, second, third = (next(draws) for _ in range(4))
    x, y, p, q, *_ = block
    if kind < 0.28:  # two wings along neighbouring sides, which overlap in a corner
        wing, other = p * (0.3 + 0.2 * first), q * (0.3 + 0.2 * second)
        right, up = (-1.0 if third % 0.5 < 0.25 else 1.0), (-1.0 if third < 0.5 else 1.0)
        return [
            _Shape(x + right * (p - wing), y, wing, q),
            _Shape(x, y + up * (q - other), p, other),
        ]
    if kind < 0.4:  # rounded corners
        radius = min(p, q) * (0.2 + 0.4 * first)
        return [_Shape(x, y, p - radius, q - radius, radius)]
    if kind < 0.54:  # askew in the block
        slope = 0.2 * first - 0.1
        cosine, sine = _direction(abs(slope))
        fit = min(p / (p * cosine + q * sine), q / (p * sine + q * cosine))
        return [_Shape(x, y, fit * p, fit * q, 0.0, slope)]
    if kind < 0.8:
        return _terrace(draws, block, 2 + int(max(p, q) / 6.0), -1.0 if third < 0.5 else 1.0)
    if kind < 0.9 and max(p, q) > 5.0:  # two buildings with an alley of 2 to 4 m
        return list(_halves(block, 2.0 + 2.0 * first, 0.4 + 0.2 * second))
    trees = []
    for _ in range(3 + int(3.0 * first)):
        size, along, across = (next(draws) for _ in range(3))
        radius = min(0.8 + 1.2 * size, p, q)
        along, across = (p - radius) * (2.0 * along - 1.0), (q - radius) * (2.0 * across - 1.0)
        trees.append(_Shape(x + along, y + across, 0.0, 0.0, radius))
    return trees


def _terrace(draws: Iterator[float], block: _Shape, number: int, side: float) -> list[_Shape]:
    """Houses in a row along the longer side of a block, overlapping, of different depths."""
    x, y, p, q, *_ = block
    long, deep = max(p, q), min(p, q)
    wide = 1.06 * long / number
    houses = []
    for k in range(number):
        along = (2.0 * k / (number - 1) - 1.0) * (long - wide)
        depth = deep * (0.55 + 0.45 * next(draws))
        across = side * (deep - depth)
        houses.append(
            _Shape(x + along, y + across, wide, depth)
            if p > q
            else _Shape(x + across, y + along, depth, wide)
        )
    return houses
