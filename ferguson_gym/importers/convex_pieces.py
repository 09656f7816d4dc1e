"""Footprints cut into convex pieces that overlap where they were cut.

Pieces that only touch would leave a way along the line between them, on which no obstacle is met.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.optional_dependencies import installing

if TYPE_CHECKING:
    from shapely import Polygon

Point: TypeAlias = tuple[float, float]
Piece: TypeAlias = list[Point]
"""Corners, counter-clockwise."""
_DEPTHS = (0.5, 0.2, 0.05)
"""How far pieces reach beyond a cut, as shares of the way to the middle of the piece beyond."""
_STRAIGHT = 1e-12
"""Sine of a turn to the right that counts as rounding."""


def check_shapely() -> None:
    """Check that shapely is installed.

    Raises:
        ValueError: it is not; the message has the command that installs it.
    """
    try:
        from shapely import constrained_delaunay_triangles  # noqa: F401
    except ImportError:
        raise ValueError(
            f"building footprints are read with shapely 2.1 or later: {installing('maps')}"
        ) from None


def convex_pieces(polygon: Polygon) -> list[Array]:
    """Convex polygons (m, 2) whose union is a polygon, which may have holes.

    It is cut into triangles, these are joined while they stay convex, and each piece then reaches
    a little into its neighbours, so that every cut lies inside a piece.

    Args:
        polygon: a valid polygon of shapely.
    """
    return [np.array(piece) for piece in _overlapping(convex_cells(polygon))]


def convex_cells(polygon: Polygon) -> list[Piece]:
    """Convex polygons that cover a polygon, which may have holes, and do not overlap.

    Two cells touch along common sides, whose two ends are corners of both.

    Args:
        polygon: a valid polygon of shapely.
    """
    from shapely import constrained_delaunay_triangles, orient_polygons

    shapes = orient_polygons(constrained_delaunay_triangles(polygon)).geoms
    return _joined([list(map(tuple, shape.exterior.coords))[:3] for shape in shapes])


def _joined(triangles: list[Piece]) -> list[Piece]:
    """Pieces from triangles, over each common side if the two together are convex."""
    pieces: dict[int, Piece] = dict(enumerate(triangles))
    sides = {side: k for k, piece in pieces.items() for side in sides_of(piece)}
    for side in sorted(sides, key=_squared_length, reverse=True):
        (a, b), mine, other = side, sides.get(side), sides.get(side[::-1])
        if mine is None or other is None or mine == other:
            continue
        # from b all around mine to a, then all around the other back to b
        whole = _from(pieces[mine], b) + _from(pieces[other], a)[1:-1]
        if len(set(whole)) == len(whole) and _is_convex(whole):
            del sides[a, b], sides[b, a], pieces[other]
            pieces[mine] = whole
            sides.update(dict.fromkeys(sides_of(whole), mine))
    return list(pieces.values())


def _overlapping(pieces: list[Piece]) -> list[Piece]:
    """Pieces that reach into each other over common sides; where none can, one is added."""
    original = [list(piece) for piece in pieces]
    sides = {side: k for k, piece in enumerate(original) for side in sides_of(piece)}
    pieces, bridges = [list(piece) for piece in pieces], []
    for a, b in [side for side in sides if side[::-1] in sides and side < side[::-1]]:
        mine, other = sides[a, b], sides[b, a]
        middle = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]))
        towards = [
            (_toward(middle, _center(original[k]), depth), into)
            for depth in _DEPTHS
            for k, into in ((other, mine), (mine, other))
        ]
        for beyond, k in towards:
            after = pieces[k].index(a if k == mine else b) + 1
            grown = [*pieces[k][:after], beyond, *pieces[k][after:]]
            if _is_convex(grown):
                pieces[k] = grown
                break
        else:
            inside = [_toward(middle, _center(original[k]), _DEPTHS[-1]) for k in (other, mine)]
            bridges.append([a, inside[0], b, inside[1]])
    return pieces + bridges


def sides_of(piece: Piece) -> Iterable[tuple[Point, Point]]:
    """The sides of a piece, each from one corner to the next."""
    return zip(piece, piece[1:] + piece[:1], strict=True)


def _from(piece: Piece, corner: Point) -> Piece:
    """The same piece, from this corner on."""
    k = piece.index(corner)
    return piece[k:] + piece[:k]


def _squared_length(side: tuple[Point, Point]) -> float:
    (ax, ay), (bx, by) = side
    return (bx - ax) ** 2 + (by - ay) ** 2


def _is_convex(piece: Piece) -> bool:
    """Whether a piece turns left at all its corners, or goes straight on."""
    edges = np.roll(np.array(piece), -1, axis=0) - np.array(piece)
    after = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    sizes = np.linalg.norm(edges, axis=1) * np.linalg.norm(after, axis=1)
    return bool((turns >= -_STRAIGHT * sizes).all())


def _center(piece: Piece) -> Point:
    x, y = np.mean(piece, axis=0).tolist()
    return x, y


def _toward(point: Point, other: Point, share: float) -> Point:
    return point[0] + share * (other[0] - point[0]), point[1] + share * (other[1] - point[1])
