"""What the way costs: making the trees of shortest paths, and steps of environments that show it.

Run it from a checkout: `.venv/bin/python benchmarks/way_cost.py [ROUNDS]`. A tree is made for each
of 20 fields of a suite. Steps are timed with and without `way=10` in turn, after the trees of all
fields are made; ratios are taken within a round, so that a slow phase of the machine affects both
alike. Everything runs on one thread, and times are those of the processor.
"""

from __future__ import annotations

import sys
import time

import numba
import numpy as np

from ferguson_gym.guidance.way import tree_of, with_margin
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field_names import get_fields

SUITES = ("standard", "dense", "forest")
FIELDS = 200
"""Number of fields that are flown, few enough that each is drawn before the measurement."""
POINTS = 10
"""Points of the way that are shown."""
MOVED = 0.05
"""Standard deviation of the actions."""


def main(rounds: int) -> None:
    """Print the tables."""
    numba.set_num_threads(1)
    margin = Settings().margin
    for suite in SUITES:
        seconds, sizes = [], []
        for field in get_fields(f"{suite}/validation:0-20"):
            began = time.process_time()
            tree = tree_of(with_margin(field, margin))
            seconds.append(time.process_time() - began)
            assert tree is not None
            sizes.append(sum(array.nbytes for array in tree))
        # the first one compiles
        made = f"{1e3 * np.median(seconds[1:]):.1f} ms, {np.median(sizes) / 1e3:.0f} kB"
        print(f"a tree of {suite}: {made}")
    for number in (1, 256):
        for suite in SUITES:
            plain, shown = (environments(number, suite, way) for way in (0, POINTS))
            pairs = np.array([[per_step(plain), per_step(shown)] for _ in range(rounds)])
            without, with_way = 1e6 * np.median(pairs, axis=0)
            ratio = np.median(pairs[:, 1] / pairs[:, 0])
            print(
                f"{number} environments of {suite}: {without:.2f} us a step, "
                f"{with_way:.2f} us with way={POINTS}, ratio {ratio:.2f}"
            )


def environments(number: int, suite: str, way: int) -> VectorObstacleField:
    """Environments that have flown all fields."""
    envs = VectorObstacleField(number, suite=suite, fields=FIELDS, way=way)
    for first in range(0, FIELDS, number):
        envs.reset(seed=first)
    for _ in range(-(-20 * FIELDS // number)):  # a field is missed with probability exp(-20)
        envs.reset()
    per_step(envs)
    return envs


def per_step(envs: VectorObstacleField, seconds: float = 0.5) -> float:
    """Time per environment and step [s]."""
    stream, steps, spent = np.random.default_rng(0), 0, 0.0
    while spent < seconds:
        moved = stream.normal(0.0, MOVED, (envs.num_envs, 4))
        actions = np.clip(moved, -1.0, 1.0).astype(np.float32)
        began = time.process_time()
        envs.step(actions)
        spent += time.process_time() - began
        steps += envs.num_envs
    return spent / steps


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 9)
