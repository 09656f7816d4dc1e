"""Certified least distance of a whole segment from a convex core, by branch and bound, compiled.

On a piece of the curve whose control points all lie where one corner is the nearest feature, the
distance is that from the corner, and `nearest_point` finds its minimum. Elsewhere the line that
supports the core in the direction of the piece's middle bounds the distance from below, since a
convex core lies behind each of its supporting lines and a Bézier curve within the hull of its
control points. Pieces are divided where the distance from that line is least, so that the bound is
attained beside an edge.
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.curves.convex_core import nearest_on_core, outward_normal
from ferguson_gym.curves.nearest_point import CUBIC, DEPTH, SHARPNESS, Rows, nearest_point
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

_NARROWEST = 1e-12
"""Pieces narrower than this in the curve's parameter are not divided: their ends are as near as any
of their points, up to a tenth of `SHARPNESS`."""


@compiled
def _is_beside_corner(
    points: Array, corners: Array, k: int, first: int, end: int, axes: Rows
) -> bool:
    """Whether corner k is the nearest feature to all control points (4, D) of a piece."""
    if end - first == 1:
        return True
    before, after = k - 1 if k > first else end - 1, k + 1 if k + 1 < end else first
    for i in range(4):
        along_before = along_after = 0.0
        for d in range(len(axes)):
            off = points[i, d] - corners[d, k]
            along_before += off * (corners[d, before] - corners[d, k])
            along_after += off * (corners[d, after] - corners[d, k])
        if along_before > 0.0 or along_after > 0.0:
            return False
    return True


@compiled
def _lowest(a: float, b: float, c: float, d: float) -> float:
    """Where in [0, 1] a cubic with Bernstein coefficients a, b, c, d is least."""
    best, where = (a, 0.0) if a <= d else (d, 1.0)
    # a third of the derivative: p - 2 (p - q) t + (p - 2 q + r) t^2
    p, q, r = b - a, c - b, d - c
    square = p - 2.0 * q + r
    root2 = (p - q) * (p - q) - square * p
    if root2 <= 0.0:
        return where
    root = np.sqrt(root2)
    share = p - q + (root if p - q >= 0.0 else -root)
    for turn in range(2):
        t = (share / square if square != 0.0 else -1.0) if turn == 0 else p / share
        if 0.0 < t < 1.0:
            s = 1.0 - t
            value = s * s * (s * a + 3.0 * t * b) + t * t * (3.0 * s * c + t * d)
            if value < best:
                best, where = value, t
    return where


@compiled
def least_core_distance(
    points: Array,
    corners: Array,
    first: int,
    end: int,
    scale: float,
    threshold: float,
    axes: Rows,
    pieces: Array,
    widths: Array,
    stack: Array,
    spans: Array,
    work: Array,
) -> tuple[float, float]:
    """Least signed distance of a cubic Bézier curve from a core, and its parameter.

    Args:
        points: (4, D) control points of the curve [m].
        corners: (D, c) [m], of which those from `first` up to `end` span the core.
        first: index of the first corner.
        end: index behind the last corner.
        scale: largest distance of a control point from a corner, or more [m].
        threshold: as for `nearest_point` [m].
        axes: the D axes.
        pieces: scratch (DEPTH, 4, D).
        widths: scratch (DEPTH, 2).
        stack: scratch of `nearest_point`, as are spans (DEPTH, 2) and work (2, 7).
        spans: scratch.
        work: scratch.

    Returns:
        A distance that the curve attains and its parameter. The true least one is smaller by at
        most 2e-10 times the scale.
    """
    dimension = len(axes)
    middle, normal, shifted = np.empty(dimension), np.empty(dimension), np.empty((4, dimension))
    for i in range(4):
        for d in range(dimension):
            pieces[0, i, d] = points[i, d]
    widths[0, 0], widths[0, 1] = 0.0, 1.0
    best = nearest_on_core(points[0], corners, first, end, axes).distance
    last = nearest_on_core(points[3], corners, first, end, axes).distance
    where = 0.0
    if last < best:
        best, where = last, 1.0
    fine, top = SHARPNESS * scale, 0
    while top >= 0:
        start, width = widths[top, 0], widths[top, 1] - widths[top, 0]
        goal = min(best - fine, threshold)
        if end - first < 3 and goal <= 0.0:  # the distance from a point or line is never negative
            break
        piece = pieces[top]
        for d in range(dimension):
            middle[d] = 0.125 * (piece[0, d] + 3.0 * (piece[1, d] + piece[2, d]) + piece[3, d])
        near = nearest_on_core(middle, corners, first, end, axes)
        if near.distance < best:
            best, where = near.distance, start + 0.5 * width
            goal = min(best - fine, threshold)
        k = near.corner
        if near.share == 0.0 and _is_beside_corner(piece, corners, k, first, end, axes):
            for i in range(4):
                for d in range(dimension):
                    shifted[i, d] = piece[i, d] - corners[d, k]
            norm, t = nearest_point(shifted, goal, CUBIC, axes, stack, spans, work)
            if norm < best:
                best, where = norm, start + t * width
            top -= 1
            continue
        split = 0.5
        if near.distance != 0.0 or near.share > 0.0:
            outward_normal(middle, near, corners, first, end, axes, normal)
            support = -np.inf
            for j in range(first, end):
                along = 0.0
                for d in range(dimension):
                    along += normal[d] * corners[d, j]
                support = max(support, along)
            lowest = np.inf
            for i in range(4):
                along = -support
                for d in range(dimension):
                    along += normal[d] * piece[i, d]
                work[0, i] = along
                lowest = min(lowest, along)
            if lowest >= goal:
                top -= 1
                continue
            split = _lowest(work[0, 0], work[0, 1], work[0, 2], work[0, 3])
            # pieces that hardly shrink would fill the stack
            split = split if 0.25 < split < 0.75 else 0.5
        if width <= _NARROWEST or top + 2 > DEPTH:
            top -= 1
            continue
        # de Casteljau's algorithm: the right part replaces the piece, the left one goes on top
        for d in range(dimension):
            a, b, c, e = piece[0, d], piece[1, d], piece[2, d], piece[3, d]
            ab, bc, ce = a + split * (b - a), b + split * (c - b), c + split * (e - c)
            abc, bce = ab + split * (bc - ab), bc + split * (ce - bc)
            cut = abc + split * (bce - abc)
            pieces[top + 1, 0, d], pieces[top + 1, 1, d] = a, ab
            pieces[top + 1, 2, d], pieces[top + 1, 3, d] = abc, cut
            pieces[top, 0, d], pieces[top, 1, d] = cut, bce
            pieces[top, 2, d], pieces[top, 3, d] = ce, e
        cut_at = start + split * width
        widths[top + 1, 0], widths[top + 1, 1] = start, cut_at
        widths[top, 0] = cut_at
        there = nearest_on_core(pieces[top, 0], corners, first, end, axes).distance
        if there < best:
            best, where = there, cut_at
        top += 1
    return best, where
