"""Corners of convex cores, brought into the form that obstacles keep: convex hulls in order."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.runtime.arrays import Array, finite, real, truncate_repr

_STRAIGHT = 1e-12
"""Corners nearer than this to the line between their neighbours are left out, as a fraction of the
size of the core."""


def hulls(cores: Iterable[ArrayLike]) -> tuple[list[Array], list[int]]:
    """Corners (m, D) of the convex hull of each core, and which cores had further points.

    In the plane they are in counter-clockwise order, without repeated and collinear ones.

    Args:
        cores: sequence of points (m, D) each [m].

    Raises:
        ValueError: not a sequence of arrays of points of the same dimension, a core without points,
            NaN or infinity, or three points and more that are not in the plane.
    """
    try:
        every = [real(f"core {k}", core) for k, core in enumerate(list(cores))]
    except TypeError:
        raise ValueError(
            "cores are a sequence of points (m, D) for each obstacle, got " + truncate_repr(cores)
        ) from None
    found, changed = [], []
    for k, core in enumerate(every):
        if core.size == 0:
            raise ValueError(f"core {k} has no points; a core needs 1 or more")
        core = finite(f"core {k}", core, (None, every[0].shape[-1] if every[0].ndim == 2 else None))
        corners, inner = hull(core, k)
        found.append(corners)
        if inner:
            changed.append(k)
    return found, changed


def hull(points: Array, number: int = 0) -> tuple[Array, bool]:
    """Corners of the convex hull of points (m, D), and whether there were other points.

    Repeated points, and those on a line between others, are not counted as others.

    Raises:
        ValueError: three different points and more in another space than the plane.
    """
    unique = points[np.lexsort(points.T[::-1])]
    unique = unique[np.r_[True, (unique[1:] != unique[:-1]).any(axis=1)]]
    if len(unique) < 3:
        return unique, False
    if points.shape[1] != 2:
        raise ValueError(
            f"core {number} has {len(unique)} points in {points.shape[1]} dimensions; polygons are "
            "planar, and elsewhere a core has 1 or 2 points"
        )
    size = float(np.ptp(unique, axis=0).max())
    chains = [_chain(unique, size), _chain(unique[::-1], size)]
    corners = np.concatenate([chains[0][:-1], chains[1][:-1]])
    if len(corners) < 3:
        return np.stack([unique[0], unique[-1]]), False
    return corners, _has_inner(unique, corners, size)


def _chain(points: Array, size: float) -> Array:
    """The lower side of a hull of sorted points, by Andrew's monotone chain."""
    chain: list[Array] = []
    for point in points:
        while len(chain) > 1 and not _is_left(chain[-2], chain[-1], point, size):
            chain.pop()
        chain.append(point)
    return np.array(chain)


def _is_left(a: Array, b: Array, c: Array, size: float) -> bool:
    """Whether b lies to the right of the line from a to c, by more than rounding."""
    long = c - a
    across = long[0] * (b[1] - a[1]) - long[1] * (b[0] - a[0])
    return bool(across < -_STRAIGHT * size * float(np.linalg.norm(long)))


def _has_inner(points: Array, corners: Array, size: float) -> bool:
    """Whether a point lies inside the hull, not on its boundary."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = edges[:, ::-1] * [1.0, -1.0] / np.linalg.norm(edges, axis=1)[:, None]
    beyond: NDArray[np.float64] = ((points[:, None] - corners) * normals).sum(axis=-1).max(axis=1)
    return bool((beyond < -1e-9 * size).any())


def warn_of_hulls(which: list[int]) -> None:
    """Say once that the points of some cores, by their numbers, were not in convex position."""
    if which:
        more = f" and {len(which) - 1} more" if len(which) > 1 else ""
        warnings.warn(
            f"the points of obstacle {which[0]}{more} are not in convex position; their convex "
            "hull is used",
            stacklevel=3,
        )
