"""Time of an exact shortest path among obstacles of several shapes: median and 99 %.

Run it from a checkout: `.venv/bin/python benchmarks/shapes.py [FIELDS]`. What is timed is what a
single path takes: building what distances to the goal come from, and the first query. Every row has
FIELDS fields (100) and each field's time is the least of nine. Fields are 120 m wide, start and
goal 141 m apart; obstacles overlap and shrink as their number grows. Compilation is not counted.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

ROWS = (
    (50, "discs"),
    (50, "5-gons"),
    (50, "12-gons"),
    (50, "mixed"),
    (200, "mixed"),
    (500, "discs"),
    (500, "mixed"),
    (2000, "mixed"),
)
"""Number and kind of obstacles."""
SIDE = 120.0
"""Of a field [m]."""
SIZES = (0.15, 0.6)
"""Least and greatest radius of the circle around an obstacle, relative to their mean spacing."""
REPEATS = 9


def core(stream: np.random.Generator, corners: int) -> Array:
    """Corners (n, 2) on a unit circle, at random angles in equal parts of it."""
    turn = 2.0 * np.pi * (np.arange(corners) + stream.uniform(0.0, 0.8, corners)) / corners
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def random_field(seed: int, number: int, kind: str) -> Field:
    """A field of random obstacles of a kind; start and goal are left free."""
    stream = np.random.default_rng([seed, number])
    spacing = SIDE / math.sqrt(number)
    cores, radii = [], []
    for k in range(number):
        center, size = stream.uniform(-10.0, 110.0, 2), stream.uniform(*SIZES) * spacing
        # discs, capsules, polygons and rounded polygons
        mixed = ((1, 1.0), (2, 0.3), (5, 0.0), (12, 0.0), (4, 0.3))[k % 5]
        alone = {"discs": (1, 1.0), "5-gons": (5, 0.0), "12-gons": (12, 0.0)}
        corners, rounded = alone.get(kind, mixed)
        cores.append(center + (1.0 - rounded) * size * core(stream, corners))
        radii.append(rounded * size)
    every = Obstacles.hulls(cores, radii)
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    free = (every.signed_distance(ends) > 0.0).all(axis=0)
    return Field(name=f"{number} {kind} {seed}", obstacles=every.only(free))


def seconds(field: Field) -> float:
    """Time of the field's shortest path [s], the least of some repeats."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        shortest_path(field)
        times.append(time.perf_counter() - began)
    return min(times)


def main(fields: int) -> None:
    """Print the table."""
    print(f"{fields} fields a row; median / 99 % [ms]")
    for number, kind in ROWS:
        shortest_path(random_field(fields, number, kind))
        times = [seconds(random_field(seed, number, kind)) for seed in range(fields)]
        median, most = 1e3 * np.percentile(times, [50.0, 99.0])
        print(f"{number:5} {kind:8} {median:8.2f} / {most:.2f}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
