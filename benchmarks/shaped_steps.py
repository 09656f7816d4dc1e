"""Steps of the vector environment in the suites of shapes, beside fields of as many discs.

Run it from a checkout: `.venv/bin/python benchmarks/shaped_steps.py`. Both environments take the
same actions in turns; a time is the median of five rounds, for one step of one environment.
"""

from __future__ import annotations

import time

import numpy as np

from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world import Field, Obstacles, get_field

MEMBERS, STEPS, ROUNDS = 64, 400, 5


def of_discs(field: Field) -> Field:
    """A field of about as many discs, of 1 to 4 m, that keep off start and goal."""
    stream = np.random.default_rng(0)
    number = len(field.obstacles)
    centers, radii = stream.uniform(-5.0, 105.0, (number, 2)), stream.uniform(1.0, 4.0, number)
    ends = np.stack([field.start, field.goal])
    near = np.linalg.norm(centers[:, None] - ends, axis=2).min(axis=1)
    kept = near > radii + 4.0
    obstacles = Obstacles.discs(centers[kept], radii[kept])
    return Field(name=f"{field.name} of discs", obstacles=obstacles)


def seconds(envs: VectorObstacleField, actions: np.ndarray) -> float:
    """Time of a step of one environment [s]."""
    began = time.perf_counter()
    for action in actions:
        envs.step(action)
    return (time.perf_counter() - began) / (len(actions) * MEMBERS)


def main() -> None:
    """Print the table."""
    stream = np.random.default_rng(1)
    actions = stream.uniform(-0.08, 0.08, (STEPS, MEMBERS, 4)).astype(np.float32)
    print("| suite | observation | shapes [us] | discs [us] | ratio |\n|" + " --- |" * 5)
    for suite in ("town", "walls"):
        shaped = [get_field(f"{suite}/train:{seed}") for seed in range(MEMBERS)]
        for observation in ("rays", "discs"):
            both = [
                VectorObstacleField(MEMBERS, fields=fields, observation=observation)
                for fields in (shaped, [of_discs(field) for field in shaped])
            ]
            for envs in both:
                envs.reset(seed=0)
            times = [[seconds(envs, actions) for envs in both] for _ in range(ROUNDS)]
            shapes, discs = 1e6 * np.median(times, axis=0)
            print(
                f"| {suite} | {observation} | {shapes:.2f} | {discs:.2f} | {shapes / discs:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
