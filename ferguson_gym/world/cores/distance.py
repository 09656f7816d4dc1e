"""Signed distance of points from obstacles of any shape, and its gradient."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores, nearest_on_core, outward_normal
from ferguson_gym.curves.nearest_point import Rows
from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.runtime.jit import compiled


def signed_distance(points: GenericArray, cores: Cores) -> GenericArray:
    """Distance of points (*batch, D) to each obstacle: (*batch, n) [m], negative inside.

    Complex points are differentiated by their imaginary parts.
    """
    flat = np.ascontiguousarray(points.real, dtype=np.float64).reshape(-1, points.shape[-1])
    distance, normal = _distances(flat, cores, tuple(range(flat.shape[1])))
    distance = distance.reshape(*points.shape[:-1], len(cores.radii))
    if not np.iscomplexobj(points):
        return distance
    normal = normal.reshape(*distance.shape, points.shape[-1])
    slope: GenericArray = (normal * points.imag[..., None, :]).sum(axis=-1)
    return distance + 1j * slope


def gradient(points: Array, cores: Cores) -> Array:
    """Gradient of `signed_distance`: (*batch, n, D)."""
    flat = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, points.shape[-1])
    _, normal = _distances(flat, cores, tuple(range(flat.shape[1])))
    return normal.reshape(*points.shape[:-1], len(cores.radii), points.shape[-1])


@compiled
def _distances(points: Array, cores: Cores, axes: Rows) -> tuple[Array, Array]:
    number = len(cores.radii)
    distance = np.empty((len(points), number))
    normal = np.empty((len(points), number, len(axes)))
    for i in range(len(points)):
        for k in range(number):
            first, end = cores.first[k], cores.first[k + 1]
            near = nearest_on_core(points[i], cores.corners, first, end, axes)
            distance[i, k] = near.distance - cores.radii[k]
            outward_normal(points[i], near, cores.corners, first, end, axes, normal[i, k])
    return distance, normal


@compiled
def are_free(
    points: Array, centers: Array, radii: Array, cores: Cores, axes: Rows
) -> NDArray[np.bool_]:
    """Whether all points of each set (m, k, D) are outside all obstacles: (m,).

    Args:
        points: (m, k, D) [m].
        centers: (n, D) of the balls that bound the obstacles [m].
        radii: (n,) of the balls [m].
        cores: of the obstacles.
        axes: the D axes.
    """
    result = np.ones(len(points), dtype=np.bool_)
    for k in range(len(points)):
        for one in range(len(radii)):
            for i in range(points.shape[1]):
                square = 0.0
                for d in range(len(axes)):
                    square += (points[k, i, d] - centers[one, d]) ** 2
                inside = square < radii[one] ** 2
                if inside and len(cores.first) > 0:
                    first, end = cores.first[one], cores.first[one + 1]
                    near = nearest_on_core(points[k, i], cores.corners, first, end, axes)
                    inside = near.distance < cores.radii[one]
                if inside:
                    result[k] = False
                    break
            if not result[k]:
                break
    return result
