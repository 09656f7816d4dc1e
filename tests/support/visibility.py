"""Shortest paths by a plain visibility graph among polygons, with shapely, and random polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles


def polygon_of(field: Field, k: int, sides: int, *, around: bool) -> np.ndarray:
    """Corners (m, 2) of obstacle k with its arcs as parts of regular polygons within or around."""
    obstacles = field.obstacles
    core, radius = obstacles.core(k), obstacles.radii[k]
    if radius == 0.0:
        return core
    radius /= math.cos(math.pi / sides) if around else 1.0
    turn = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    whole = shapely.convex_hull(shapely.multipoints((core[:, None] + ring).reshape(-1, 2)))
    return shapely.get_coordinates(whole)[:-1]


def visibility_lengths(
    field: Field,
    points: Sequence[Sequence[float]] | np.ndarray,
    sides: int = 64,
    *,
    around: bool = False,
) -> np.ndarray:
    """Lengths (n,) of shortest paths from points (n, 2) to the goal, infinite where there is none.

    Exact among polygons without radii; otherwise arcs are chords, or tangents if `around`.
    """
    low, high = field.bounds
    margin = 1e-9 * float((high - low).max())
    every = [polygon_of(field, k, sides, around=around) for k in range(len(field.obstacles))]
    shrunk = shapely.buffer([shapely.polygons(one) for one in every], -margin, join_style="mitre")
    corners = np.concatenate([field.goal[None], np.asarray(points), *every])
    inside = ((corners >= low - margin) & (corners <= high + margin)).all(axis=1)
    solid = shapely.unary_union([one for one in shrunk if not one.is_empty])
    shapely.prepare(solid)
    inside &= ~shapely.intersects(solid, shapely.points(corners))
    first, second = np.triu_indices(len(corners), 1)
    pairs = inside[first] & inside[second]
    first, second = first[pairs], second[pairs]
    lines = shapely.linestrings(np.stack([corners[first], corners[second]], axis=1))
    free = ~shapely.intersects(solid, lines)
    first, second = first[free], second[free]
    # dijkstra takes no edges of length zero
    lengths = np.maximum(np.linalg.norm(corners[first] - corners[second], axis=1), 1e-300)
    graph = csr_array((lengths, (first, second)), shape=(len(corners), len(corners)))
    found: np.ndarray = dijkstra(graph, directed=False, indices=0)[1 : 1 + len(points)]
    return found


def random_polygons(
    seed: int, number: int, sides: int = 5, largest: float = 20.0, *, rounded: float = 0.0
) -> Field:
    """Random polygons that may overlap each other and the bounds; start and goal are left free."""
    stream = np.random.default_rng(seed)
    cores = []
    for _ in range(number):
        turn = np.sort(stream.uniform(0.0, 2.0 * np.pi, sides))
        size = stream.uniform(1.0, largest)
        circle = np.stack([np.cos(turn), stream.uniform(0.1, 1.0) * np.sin(turn)], axis=1)
        tilt = stream.uniform(0.0, np.pi)
        rotation = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
        cores.append(stream.uniform(-10.0, 110.0, 2) + size * circle @ rotation.T)
    every = Obstacles.hulls(cores, stream.uniform(0.0, rounded, number) if rounded else 0.0)
    free = (every.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])) > 0.0).all(axis=0)
    return Field(name=f"polygons {seed}", obstacles=every.only(free))


def random_mixture(seed: int, *, shapes: bool = True) -> Field:
    """Random discs and, if wanted, polygons with and without rounded corners, and capsules."""
    stream = np.random.default_rng(seed)
    centers = stream.uniform(-10.0, 110.0, (int(stream.integers(4, 14)), 2))
    parts = [Obstacles.discs(centers, stream.uniform(0.5, 15.0, len(centers)))]
    if shapes:
        ends = stream.uniform(-10.0, 110.0, (5, 1, 2)) + stream.normal(0.0, 12.0, (5, 2, 2))
        parts.append(Obstacles.capsules(ends, stream.uniform(0.2, 5.0, 5)))
        parts.append(random_polygons(seed, 6, 3 + seed % 5, 25.0).obstacles)
        parts.append(random_polygons(seed + 1, 4, 4, 15.0, rounded=5.0).obstacles)
    every = Obstacles.joined(parts)
    free = (every.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])) > 0.0).all(axis=0)
    return Field(name=f"mixture {seed}", obstacles=every.only(free))
