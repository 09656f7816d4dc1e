"""How far two convex cores are apart, or how deeply they overlap, compiled."""

from __future__ import annotations

import numpy as np

from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

_ROUNDING = 1e-14
"""Areas below this multiple of the squared lengths that they are made of count as zero."""


@compiled
def cores_gap(
    one: Array, first: int, end: int, other: Array, begin: int, stop: int, axes: Rows
) -> float:
    """Signed distance of two cores [m].

    Where their insides overlap it is negative: the shortest distance by which one of them has to
    be moved until they do not. Arguments are as for `boundaries_apart`.
    """
    if end - first > 2 or stop - begin > 2:
        # where the insides of plane cores overlap, no line separates them; some edge is the best
        best = max(
            _separation(one, first, end, other, begin, stop),
            _separation(other, begin, stop, one, first, end),
        )
        if best < 0.0:
            return best
    return boundaries_apart(one, first, end, other, begin, stop, axes)


@compiled
def boundaries_apart(
    one: Array, first: int, end: int, other: Array, begin: int, stop: int, axes: Rows
) -> float:
    """Distance between the boundaries of two cores [m], also where one lies inside the other.

    Args:
        one: (D, c) corners [m], of which those from `first` up to `end` span a core.
        first: index of its first corner.
        end: index behind its last corner.
        other: (D, d) corners [m], of which those from `begin` up to `stop` span the other core.
        begin: index of its first corner.
        stop: index behind its last corner.
        axes: the D axes.
    """
    least = np.inf
    for k in range(first, end if end - first > 2 else first + 1):
        after = k + 1 if k + 1 < end else first
        for i in range(begin, stop if stop - begin > 2 else begin + 1):
            ahead = i + 1 if i + 1 < stop else begin
            least = min(least, _lines_apart2(one, k, after, other, i, ahead, axes))
    return float(np.sqrt(least))


@compiled
def _separation(one: Array, first: int, end: int, other: Array, begin: int, stop: int) -> float:
    """How far another core lies beyond the edge of a plane core that separates them best [m].

    A line has an edge on both sides, and a point has none.
    """
    best = -np.inf
    for k in range(first, end if end - first > 1 else first):
        after = k + 1 if k + 1 < end else first
        ex, ey = one[0, after] - one[0, k], one[1, after] - one[1, k]
        size = np.sqrt(ex * ex + ey * ey)
        least = np.inf
        for i in range(begin, stop):
            beyond = (other[0, i] - one[0, k]) * ey - (other[1, i] - one[1, k]) * ex
            least = min(least, beyond / size)
        best = max(best, least)
    return best


@compiled
def _lines_apart2(
    one: Array, k: int, after: int, other: Array, i: int, ahead: int, axes: Rows
) -> float:
    """Squared distance between the lines from corners k to `after` and from i to `ahead`."""
    long2 = wide2 = both = from_one = from_other = off2 = 0.0
    for d in range(len(axes)):
        u, v = one[d, after] - one[d, k], other[d, ahead] - other[d, i]
        off = one[d, k] - other[d, i]
        long2 += u * u
        wide2 += v * v
        off2 += off * off
        both += u * v
        from_one += u * off
        from_other += v * off
    least = min(
        _apart2(one, k, other, i, ahead, axes),
        _apart2(one, after, other, i, ahead, axes),
        _apart2(other, i, one, k, after, axes),
        _apart2(other, ahead, one, k, after, axes),
    )
    if len(axes) == 2:
        # nearer to a side than rounding, an end is as near to the other line
        rounding = _ROUNDING * (long2 + wide2 + off2)
        crosses = _lie_apart(one, k, after, other, i, ahead, rounding)
        crosses = crosses and _lie_apart(other, i, ahead, one, k, after, rounding)
        return 0.0 if crosses else least
    # the points where the lines are nearest if both went on
    area2 = long2 * wide2 - both * both
    if area2 > 0.0:
        s = (both * from_other - from_one * wide2) / area2
        t = (long2 * from_other - both * from_one) / area2
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            apart2 = 0.0
            for d in range(len(axes)):
                u, v = one[d, after] - one[d, k], other[d, ahead] - other[d, i]
                apart2 += (one[d, k] - other[d, i] + s * u - t * v) ** 2
            least = min(least, apart2)
    return least


@compiled
def _lie_apart(
    one: Array, k: int, after: int, other: Array, i: int, ahead: int, rounding: float
) -> bool:
    """Whether corners i and `ahead` lie on different sides of the line from k to `after`."""
    ux, uy = one[0, after] - one[0, k], one[1, after] - one[1, k]
    begin = ux * (other[1, i] - one[1, k]) - uy * (other[0, i] - one[0, k])
    end = ux * (other[1, ahead] - one[1, k]) - uy * (other[0, ahead] - one[0, k])
    apart: bool = min(begin, end) < -rounding and max(begin, end) > rounding
    return apart


@compiled
def _apart2(one: Array, k: int, other: Array, i: int, ahead: int, axes: Rows) -> float:
    """Squared distance of corner k from the line between corners i and `ahead` of another core."""
    along = size2 = 0.0
    for d in range(len(axes)):
        edge = other[d, ahead] - other[d, i]
        along += edge * (one[d, k] - other[d, i])
        size2 += edge * edge
    share = min(max(along / size2, 0.0), 1.0) if size2 > 0.0 else 0.0
    apart2 = 0.0
    for d in range(len(axes)):
        off = one[d, k] - other[d, i] - share * (other[d, ahead] - other[d, i])
        apart2 += off * off
    return apart2
