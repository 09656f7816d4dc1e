"""Lattices of discs with narrow lanes, like orchards and stacks of pallets, drawn from a seed."""

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

KINDS = ("square", "hexagonal", "jittered", "rotated")


def lattice(seed: int, lanes: tuple[float, float] = (0.3, 1.2)) -> Field:
    """A lattice with a pitch of 3.5 to 7 m and lanes between the given widths [m].

    Start and goal lie in lanes at opposite sides of the field.
    """
    stream, kind = np.random.RandomState(seed), KINDS[seed % 4]
    pitch, lane = stream.uniform(3.5, 7.0), stream.uniform(*lanes)
    number = int(np.ceil(170.0 / pitch))
    column, row = np.meshgrid(*2 * [np.arange(-number, number + 1)], indexing="ij")
    if kind == "hexagonal":
        grid = np.stack([column + 0.5 * (row % 2), row * np.sqrt(0.75)], axis=-1)
    else:
        grid = np.stack([column, row], axis=-1)
    centers = pitch * grid.reshape(-1, 2).astype(np.float64)
    radii = np.full(len(centers), 0.5 * (pitch - lane))
    turned = kind in ("rotated", "hexagonal") and stream.rand() < 0.7
    angle = stream.uniform(0.0, 0.5 * np.pi) if turned else 0.0
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    centers = centers @ rotation + 50.0 + stream.uniform(0.0, pitch, 2)
    if kind == "jittered":
        centers += stream.uniform(-0.4, 0.4, centers.shape) * lane
        radii *= stream.uniform(0.9, 1.0, len(radii))
    inside = ((centers > -5.0) & (centers < 105.0)).all(axis=1)
    discs = Obstacles.discs(centers[inside], radii[inside])
    return Field(
        name=f"{kind} lattice {seed}",
        obstacles=discs,
        start=_free_point(stream, discs, (0.0, 0.0), (20.0, 100.0)),
        goal=_free_point(stream, discs, (80.0, 0.0), (100.0, 100.0)),
    )


def narrow_lanes() -> Field:
    """A square lattice of pitch 4.7 m whose lanes are 5 cm wide."""
    middle = 4.7 * (np.arange(-1, 22) + 0.5)
    centers = np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)
    radius, ends = 2.35 * 0.99, np.array([[0.0, 5.0], [100.0, 95.0]])
    apart = np.linalg.norm(centers[:, None] - ends, axis=2).min(axis=1) >= radius
    discs = Obstacles.discs(centers[apart], np.full(int(apart.sum()), radius))
    return Field(name="narrow lanes", obstacles=discs, start=ends[0], goal=ends[1])


def _free_point(
    stream: np.random.RandomState,
    discs: Obstacles,
    low: tuple[float, float],
    high: tuple[float, float],
) -> Array:
    """A point at least 5 cm away from discs."""
    while True:
        point = stream.uniform(low, high, 2)
        if discs.signed_distance(point).min() > 0.05:
            return point
