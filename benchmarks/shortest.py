"""Time of shortest paths, distances to the goal and classes, per suite.

Run it from a checkout: `.venv/bin/python benchmarks/shortest.py [FIELDS]`. Fields 0 to FIELDS - 1
of each suite's validation split, 100 by default; compilation is not counted.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.shortest_paths.homotopy_classes import classes
from ferguson_gym.world.field_names import get_fields

T = TypeVar("T")
POINTS = np.random.default_rng(0).uniform(0.0, 100.0, (1000, 2))


def timed(action: Callable[[], T]) -> tuple[T, float]:
    """What an action returns, and how long it took [ms]."""
    began = time.perf_counter()
    result = action()
    return result, 1e3 * (time.perf_counter() - began)


def main(number: int) -> None:
    """Print median, 95th percentile and greatest time for each suite."""
    print(f"{number} fields a suite; median / 95 % / most [ms], queries in microseconds a point")
    for suite in ("standard", "sparse", "dense", "forest", "traps"):
        times = np.empty((number, 3))
        fields = list(get_fields(f"{suite}/validation:0-{number - 1}"))
        for action in (shortest_path, lambda field: classes(DistanceToGoal(field), field.start, 5)):
            action(fields[0])  # compile
        DistanceToGoal(fields[0])(POINTS)
        for k, field in enumerate(fields):
            _, times[k, 0] = timed(lambda field=field: shortest_path(field))
            togo = DistanceToGoal(field)
            _, times[k, 1] = timed(lambda togo=togo, field=field: classes(togo, field.start, 5))
            (distance, _), milliseconds = timed(lambda togo=togo: togo(POINTS))
            # points that are not free cost nothing
            times[k, 2] = 1e3 * milliseconds / np.isfinite(distance).sum()
        cells = [
            " / ".join(f"{value:.2f}" for value in np.percentile(column, [50, 95, 100]))
            for column in times.T
        ]
        print(f"{suite:9} shortest path {cells[0]}, 5 classes more {cells[1]}, query {cells[2]}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
