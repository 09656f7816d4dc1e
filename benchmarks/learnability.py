"""What makes the environment learnable: PPO on standard/train, judged by SPL on validation.

Run it from a checkout with the extra `agents`:

    .venv/bin/python benchmarks/learnability.py study --out results/learnability
    .venv/bin/python benchmarks/learnability.py train --minutes 60 --out results/ppo

`study` gives every variant the same number of steps and the same seeds, one variant
after another, and goes on where it was stopped; `train` flies the chosen settings for an hour.
Both choose on standard/validation:0-199; `train` reports standard/validation:200-999.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from learnability_variants import CHOSEN, LEARNER, PHASES, REFINING, VARIANTS, Variant
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.outcome import Outcome

ENVIRONMENTS = 256
EVERY = 500_000
"""Steps between evaluations of a training."""
CHOSEN_ON, REPORTED_ON = "standard/validation:0-199", "standard/validation:200-999"

POLICY: dict[str, Any] = {"net_arch": {"pi": [256, 256], "vf": [256, 256]}, "log_std_init": -1.5}


class Wrapped(VecEnvWrapper):
    """Environments whose observations or actions mean something else."""

    def __init__(self, venv: VecEnv, variant: Variant) -> None:
        super().__init__(venv, action_space=variant.space)
        self._see, self._act = variant.see, variant.act

    def reset(self) -> Any:
        """Start all flights."""
        return self._see(self.venv.reset())

    def step_async(self, actions: Any) -> None:
        """Hand on what the actions mean."""
        self.venv.step_async(self._act(actions))

    def step_wait(self) -> Any:
        """Step, and show what is seen in the other way."""
        seen, reward, done, infos = self.venv.step_wait()
        for info in infos:
            if "terminal_observation" in info:
                info["terminal_observation"] = self._see(info["terminal_observation"][None])[0]
        return self._see(seen), reward, done, infos


@dataclass(frozen=True, kw_only=True)
class Score:
    """Of deterministic flights; SPL is the mean of success x shortest / max(flown, shortest)."""

    spl: float
    success: float
    length: float
    """Median over arrivals [m]."""
    outcomes: list[int]
    """Flights by outcome code."""


def fly(model: PPO, variant: Variant, fields: str) -> Score:
    """Fly the policy's mean action through fields, all at once."""
    flown = list(get_fields(fields))
    envs = VectorObstacleField(
        len(flown), autoreset_mode="Disabled", fields=1, **{**CHOSEN, **variant.environment}
    )
    seen, info = envs.reset(seed=0, options={"field": flown})
    over = np.zeros(len(flown), np.bool_)
    outcome, length = np.zeros(len(flown), np.int64), np.zeros(len(flown))
    while not over.all():
        flat = np.concatenate(list(seen.values()), axis=1)
        actions, _ = model.predict(variant.see(flat), deterministic=True)
        seen, _, terminated, truncated, info = envs.step(variant.act(actions).astype(np.float32))
        ended = terminated | truncated
        first = ended & ~over
        outcome[first], length[first] = info["outcome"][first], info["path_length"][first]
        over |= ended
        if ended.any():
            seen, _ = envs.reset(options={"reset_mask": ended, "field": flown})
    exact = np.array([exact_length(one) for one in flown], np.float64)
    arrived = outcome == Outcome.GOAL_REACHED.code
    spl = np.where(arrived, exact / np.maximum(length, exact), 0.0)
    return Score(
        spl=float(spl.mean()),
        success=float(arrived.mean()),
        length=float(np.median(length[arrived])) if arrived.any() else float("nan"),
        outcomes=np.bincount(outcome, minlength=9).tolist(),
    )


class Watch(BaseCallback):
    """Evaluates now and then, keeps the best policy, and stops after so many seconds.

    Goes on from the curve that lies in its directory, if one does.
    """

    def __init__(self, variant: Variant, every: int, seconds: float, out: Path) -> None:
        super().__init__()
        out.mkdir(parents=True, exist_ok=True)
        known = out / "curve.json"
        self.curve: list[dict[str, Any]] = json.loads(known.read_text()) if known.exists() else []
        self._variant, self._every, self._seconds, self._out = variant, every, seconds, out
        last = self.curve[-1] if self.curve else {"minutes": 0.0, "steps": 0}
        self._began, self._before = time.monotonic() - 60.0 * last["minutes"], last["steps"]

    @property
    def elapsed(self) -> float:
        """Seconds since training began, breaks left out."""
        return time.monotonic() - self._began

    def go_on(self, variant: Variant, seconds: float) -> None:
        """Watch the next phase, until so many seconds after the beginning of the first."""
        self._variant, self._seconds = variant, seconds
        self._before += self.num_timesteps
        self.num_timesteps = 0

    def _on_step(self) -> bool:
        return self.elapsed < self._seconds

    def _on_rollout_end(self) -> None:
        steps = self._before + self.num_timesteps
        if steps < self._every * (len(self.curve) + 1):
            return
        score = fly(self.model, self._variant, CHOSEN_ON)
        if score.spl > max((point["spl"] for point in self.curve), default=-1.0):
            with atomic_write(self._out / "best.zip") as temporary:
                self.model.save(temporary)
        minutes = self.elapsed / 60.0
        self.curve.append({"steps": steps, "minutes": minutes, **vars(score)})
        with atomic_write(self._out / "curve.json") as temporary:
            temporary.write_text(json.dumps(self.curve, indent=1) + "\n")
        print(
            f"{steps:>10} steps {minutes:6.1f} min   SPL {score.spl:.3f}   "
            f"success {score.success:.3f}   {score.length:.1f} m",
            flush=True,
        )


def environments(variant: Variant, seed: int, arguments: dict[str, Any]) -> VecEnv:
    """The environments of a run, seeded."""
    envs = ObstacleFieldVecEnv(
        ENVIRONMENTS,
        flat=True,
        fields=100_000,
        **{**CHOSEN, **variant.environment, **arguments},
    )
    envs.seed(seed * ENVIRONMENTS)
    return Wrapped(envs, variant)


def learn(
    variant: Variant,
    seed: int,
    steps: int,
    watch: Watch,
    weights: dict[str, Any] | None = None,
    rate: Callable[[float], float] | None = None,
) -> PPO:
    """Train a policy, from given weights if there are any."""
    half = steps // 2 if variant.before else 0
    learner = {**LEARNER, **variant.learner} | ({"learning_rate": rate} if rate else {})
    model = PPO(
        "MlpPolicy",
        environments(variant, seed, variant.before or {}),
        seed=seed,
        device="cpu",
        policy_kwargs=POLICY,
        **learner,
    )
    if weights is not None:
        model.policy.load_state_dict(weights)
    if half:
        model.learn(half, callback=watch)
        model.set_env(environments(variant, seed + 1, {}))
    return model.learn(steps - half, callback=watch, reset_num_timesteps=not half)


def study(steps: int, seeds: int, out: Path) -> None:
    """Train every variant for the same number of steps, and print the table."""
    rows = []
    for name, variant in VARIANTS.items():
        scores = []
        for seed in range(seeds):
            place = out / name.replace(" ", "-").replace(",", "").replace("'", "") / str(seed)
            done = place / "score.json"
            if not done.exists():
                print(f"{name}, seed {seed}", flush=True)
                model = learn(variant, seed, steps, Watch(variant, steps, 1e9, place))
                done.write_text(json.dumps(vars(fly(model, variant, CHOSEN_ON))))
            scores.append(Score(**json.loads(done.read_text())))
        rows.append((name, scores))
    print(f"\nafter {steps} steps: SPL, success, median length of arrivals [m]; one column a seed")
    for name, scores in rows:
        cells = "   ".join(f"{s.spl:.3f} {s.success:.3f} {s.length:6.1f}" for s in scores)
        print(f"{name:42} {cells}")


def train(minutes: float, seed: int, out: Path) -> None:
    """Train through the phases; each begins with the best policy so far.

    With the dearer failure from the beginning, policies learn to fly around the field.
    """
    seconds, best = 60.0 * minutes, out / "best.zip"
    watch = Watch(PHASES[0].variant, EVERY, 0.0, out)
    end = time.monotonic() - watch.elapsed + seconds  # a number alone: models are saved with it

    def rate(_: float) -> float:
        left = (end - time.monotonic()) / ((1.0 - PHASES[0].until) * seconds)
        return float(REFINING["learning_rate"] * max(left, 0.02))

    for number, phase in enumerate(PHASES):
        if watch.elapsed >= phase.until * seconds:
            continue
        watch.go_on(phase.variant, phase.until * seconds)
        weights = PPO.load(best, device="cpu").policy.state_dict() if best.exists() else None
        learn(phase.variant, seed + number, 10**9, watch, weights, rate if number else None)
    score = fly(PPO.load(best, device="cpu"), PHASES[-1].variant, REPORTED_ON)
    (out / "score.json").write_text(json.dumps(vars(score), indent=1) + "\n")
    print(
        f"{watch.curve[-1]['steps']} steps in {minutes:g} minutes; on {REPORTED_ON}: SPL "
        f"{score.spl:.3f}, success {score.success:.3f}, median length {score.length:.1f} m"
    )


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("study", help="compare variants")
    one.add_argument("--steps", type=int, default=500_000)
    one.add_argument("--seeds", type=int, default=1)
    one.set_defaults(run=lambda given: study(given.steps, given.seeds, given.out))
    two = commands.add_parser("train", help="train the chosen settings")
    two.add_argument("--minutes", type=float, default=60.0)
    two.add_argument("--seed", type=int, default=0)
    two.set_defaults(run=lambda given: train(given.minutes, given.seed, given.out))
    for command in (one, two):
        command.add_argument("--out", type=Path, required=True)
        command.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    given.run(given)


if __name__ == "__main__":
    main()
