"""Polygons that obstacles are circumscribed by.

An obstacle is the intersection of its supporting half-planes. A few of them make a polygon around
it: those of its flat sides, which are kept exactly, and where it is round, those with normals at
equal angles. Further normals point at places that have to remain free (start and goal) and, where
two obstacles leave a passage so narrow that the polygons could close it, at the other obstacle; so
every passage stays as wide as it is at its narrowest place.

Distances between obstacles need shapely.
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.obstacles import Obstacles

_APART = 1e-7
"""Normals closer to each other than this are taken as one [rad]."""


def circumscribed(obstacles: Obstacles, corners: int, free: Array) -> list[Array]:
    """The corners (m, 2) of a polygon around each obstacle, counter-clockwise [m].

    Args:
        obstacles: n obstacles in the plane.
        corners: of a disc's polygon, before further normals are added; 3 or more.
        free: places (k, 2) outside all obstacles that no polygon may contain.
    """
    towards = _towards_neighbours(obstacles, corners)
    regular = 2.0 * np.pi * np.arange(corners) / corners
    reach = obstacles.radii + excess(obstacles.radii, corners)
    polygons = []
    for k, radius in enumerate(obstacles.radii.tolist()):
        core = obstacles.core(k)
        angles = [_side_normals(core)]
        if radius > 0.0:
            angles += [regular, np.array(towards[k]), _towards(core, reach[k], free)]
        polygons.append(_polygon(core, radius, np.concatenate(angles)))
    return polygons


def excess(radii: Array, corners: int) -> Array:
    """How far the corners of circumscribed polygons lie outside of arcs (n,) [m]."""
    out: Array = radii * (1.0 / np.cos(np.pi / corners) - 1.0)
    return out


def _side_normals(core: Array) -> Array:
    """Angles (m,) of the outward normals of a core's sides; a line has two [rad]."""
    if len(core) == 1:
        return np.empty(0)
    sides = np.roll(core, -1, axis=0) - core
    angles: Array = np.arctan2(-sides[:, 0], sides[:, 1])
    return angles


def _towards(core: Array, reach: float, places: Array) -> Array:
    """Directions from the nearest points of a core to the places (k, 2) within `reach` [rad]."""
    after = np.roll(core, -1, axis=0)
    sides = after - core
    squared = np.maximum((sides * sides).sum(axis=1), np.finfo(float).tiny)
    share = ((places[:, None] - core) * sides).sum(axis=2) / squared
    nearest = core + np.clip(share, 0.0, 1.0)[..., None] * sides
    offsets = places[:, None] - nearest
    distances = np.linalg.norm(offsets, axis=2)
    away = offsets[np.arange(len(places)), distances.argmin(axis=1)]
    away = away[distances.min(axis=1) < reach]
    angles: Array = np.arctan2(away[:, 1], away[:, 0])
    return angles


def _towards_neighbours(obstacles: Obstacles, corners: int) -> list[list[float]]:
    """For each obstacle, the directions to those that a narrow passage separates from it [rad]."""
    if len(obstacles) == 0:
        return []
    import shapely

    cores = [
        shapely.Point(core[0])
        if len(core) == 1
        else shapely.LineString(core)
        if len(core) == 2
        else shapely.Polygon(core)
        for core in (obstacles.core(k) for k in range(len(obstacles)))
    ]
    beyond = excess(obstacles.radii, corners)
    tree = shapely.STRtree(cores)
    reach = obstacles.radii + beyond
    found: list[list[float]] = [[] for _ in cores]
    one, other = tree.query(cores, "dwithin", distance=reach + reach.max())
    for i, k in zip(one.tolist(), other.tolist(), strict=True):
        line = shapely.shortest_line(cores[i], cores[k])
        passage = line.length - obstacles.radii[i] - obstacles.radii[k]
        if i != k and 0.0 < passage < beyond[i] + beyond[k]:
            (ax, ay), (bx, by) = line.coords
            found[i].append(float(np.arctan2(by - ay, bx - ax)))
    return found


def _polygon(core: Array, radius: float, angles: Array) -> Array:
    """The polygon (m, 2) of a grown core's supporting lines with normals at these angles [rad]."""
    angles = np.sort(np.mod(angles, 2.0 * np.pi))
    gap = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    angles = angles[gap > _APART]
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    support = (normals @ core.T).max(axis=1) + radius
    after, beyond = np.roll(normals, -1, axis=0), np.roll(support, -1)
    turn = normals[:, 0] * after[:, 1] - normals[:, 1] * after[:, 0]
    x = (support * after[:, 1] - beyond * normals[:, 1]) / turn
    y = (beyond * normals[:, 0] - support * after[:, 0]) / turn
    return np.column_stack([x, y])
