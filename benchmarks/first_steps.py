"""Steps per second of the vector environment right after a reset, beside later ones.

A reset of a new environment makes fields; with fewer environments some are made by later steps. All
is measured in one run, in new environments one after the other. Run it from a checkout:

    .venv/bin/python benchmarks/first_steps.py
    NUMBA_NUM_THREADS=1 .venv/bin/python benchmarks/first_steps.py --suite forest
"""

from __future__ import annotations

import argparse
import time

import gymnasium as gym
import numpy as np

from ferguson_gym import ENVIRONMENT_ID

DEVIATION = 0.05
"""Standard deviation of the actions around zero, as in `ferguson bench env`."""
COLUMNS = ("seconds", "made [ms]", "reset [ms]", "first [1/s]", "later [1/s]", "ratio", "all")


def measure(number: int, suite: str, steps: int, seed: int, cpu: bool) -> tuple[float, ...]:
    """Times of making and of the reset [s], and steps per second of first and of later ones."""
    clock = time.process_time if cpu else time.perf_counter
    stream = np.random.default_rng(seed)
    actions = np.clip(stream.normal(0.0, DEVIATION, (64, number, 4)), -1.0, 1.0).astype(np.float32)
    times = [clock()]
    envs = gym.make_vec(
        ENVIRONMENT_ID, number, vectorization_mode="vector_entry_point", suite=suite
    )
    times.append(clock())
    envs.reset(seed=seed)
    times.append(clock())
    calls = -(-steps // number)
    for k in range(6 * calls):
        envs.step(actions[k % 64])
        if (k + 1) % calls == 0:
            times.append(clock())
    taken = np.diff(times)
    # of the five later slices the median
    return taken[0], taken[1], calls * number / taken[2], calls * number / np.median(taken[3:])


def main() -> None:
    """Print a row for each new environment, in seconds and in seconds of all cores together."""
    parser = argparse.ArgumentParser(description="Steps per second after a reset, and later.")
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--suite", default="standard")
    parser.add_argument("--steps", type=int, default=100_000, help="steps of a slice")
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    measure(given.envs, given.suite, 2 * given.envs, 0, False)  # compiles
    print(f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}")
    for seed in range(given.rounds):
        for cpu in (False, True):
            made, reset, first, later = measure(given.envs, given.suite, given.steps, seed, cpu)
            together = given.steps / (reset + given.steps / first)
            print(
                f"| {'of cores' if cpu else 'elapsed'} | {1e3 * made:.1f} | {1e3 * reset:.1f} "
                f"| {first:,.0f} | {later:,.0f} | {first / later:.2f} | {together / later:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
