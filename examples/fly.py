"""Fly with `env.step`: a rule of a few lines chooses segments from the rays.

Run it from a checkout; it takes seconds:

    .venv/bin/python examples/fly.py
    .venv/bin/python examples/fly.py --seed 10 --out results/elsewhere

It prints every step of one flight and its outcome, saves the picture `fly.png`, and counts in how
many of a hundred fields the rule reaches the goal: in 96, some by a detour of twice the length.
The docstring of `ferguson_gym.environment.ObstacleField` specifies observation, action and reward.
"""

import argparse
from pathlib import Path

import gymnasium as gym
import numpy as np
from PIL import Image

import ferguson_gym  # registers the environment
from ferguson_gym.world import Outcome, encode

RAYS, VIEW = 64, 30.0  # rays all around the vehicle; what they measure is a part of 30 m
DIAGONAL = 120.0 * np.sqrt(2.0)  # and the distance to the goal a part of the bounds' diagonal

# the first ray points forward, the next ones to the left of it: angles in [-pi, pi)
ANGLES = (2.0 * np.pi * np.arange(RAYS) / RAYS + np.pi) % (2.0 * np.pi) - np.pi
WAYS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
HERE, FORWARD = np.zeros(2), np.array([1.0, 0.0])


def choose(observation: dict[str, np.ndarray]) -> np.ndarray:
    """The next action: turn to where much is free and the goal not far off."""
    distance, ahead, left = observation["goal"]
    goal = DIAGONAL * distance * np.array([ahead, left])  # [m], as the vehicle sees it
    rays = VIEW * observation["rays"]
    free = np.minimum(rays, np.minimum(np.roll(rays, 1), np.roll(rays, -1)))

    towards_goal = WAYS @ (ahead, left)  # cosines: 1 towards the goal, -1 away from it
    worth = np.minimum(free, 20.0) * (1.5 + towards_goal)
    worth[WAYS[:, 0] < -0.4] = 0.0  # a segment back would have a corner, and be refused
    best = worth.argmax()
    end = np.clip(free[best] / 2.0, 3.2, 9.0) * WAYS[best]
    if np.linalg.norm(goal) < min(12.0, free[towards_goal.argmax()]):
        end = goal

    # a segment: start, end, derivatives there; it arrives in the direction it went
    return encode([HERE, end, FORWARD, end], HERE, FORWARD)


def fly(env: gym.Env, seed: int, tell: bool = False) -> Outcome:
    """Fly the field of this seed; how it ended."""
    observation, info = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = env.step(choose(observation))
        if tell:
            way, room = info["path_length"], info["clearance"]
            told = f"{way:7.2f} m, clearance {room:.2f} m, reward {reward:+.3f}"
            print(f"{info['segments']:3} {told}")
    return Outcome.from_code(info["outcome"])


def main(seed: int, out: Path) -> None:
    """Fly once and look at it, then a hundred times."""
    env = gym.make(
        ferguson_gym.ENVIRONMENT_ID,
        render_mode="rgb_array",
        observation="rays",
        rays=RAYS,
        view=VIEW,
    )
    print(f"standard/train:{seed}: {fly(env, seed, tell=True).sentence}")
    out.mkdir(parents=True, exist_ok=True)
    Image.fromarray(env.render()).save(out / "fly.png")
    arrived = sum(fly(env, number).success for number in range(100))
    print(f"standard/train:0-99: {arrived} of 100 arrived; the first is in {out / 'fly.png'}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=3, help="of the field that is drawn")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    main(**vars(parser.parse_args()))
