"""The environments that `ferguson bench env` measures, and drivers that step them.

A driver steps an environment for a slice of time; the next slice continues from there.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv
from numpy.typing import NDArray

from agents.benchmarks.environment.subprocess_envs import in_processes
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.simulation.batch_simulator import FIRST_BLOCK
from ferguson_gym.simulation.settings import Settings

FIELDS = Settings().fields
"""Number of fields from which resets draw."""
DEVIATION = 0.05
"""Standard deviation of the actions around zero; larger actions end flights at once."""


class Slice(NamedTuple):
    """The steps and flights of a slice of time."""

    steps: int
    """Steps of single environments; resets do not count."""
    flights: int
    """Finished flights (episodes)."""
    seconds: float


class Driver(ABC):
    """Steps an environment for a time, with actions (batches, environments, ...) in turn."""

    def __init__(self, env: Any, actions: NDArray[Any]) -> None:
        self._env, self._actions = env, itertools.cycle(list(actions))

    def reset(self, seed: int) -> None:
        """Seed the environment and start all flights."""
        self._env.reset(seed=seed)
        self._env.reset()

    @abstractmethod
    def run(self, seconds: float) -> Slice:
        """Step for some seconds, at least once; finished flights are followed by others."""


class OneByOne(Driver):
    """Steps a scalar environment."""

    def __init__(self, env: gym.Env[Any, Any], actions: NDArray[Any]) -> None:
        super().__init__(env, actions[:, 0])

    def run(self, seconds: float) -> Slice:
        """Step; each step counts."""
        env, actions = self._env, self._actions
        steps = flights = 0
        began = now = time.perf_counter()
        while now < began + seconds or not steps:
            _, _, terminated, truncated, _ = env.step(next(actions))
            if terminated or truncated:
                env.reset()
                flights += 1
            steps += 1
            now = time.perf_counter()
        return Slice(steps, flights, now - began)


class Together(Driver):
    """Steps a vector environment that resets a flight in the step after its last."""

    def __init__(self, envs: VectorEnv[Any, Any, Any], actions: NDArray[Any]) -> None:
        super().__init__(envs, actions)
        self._over = np.zeros(envs.num_envs, np.bool_)

    def reset(self, seed: int) -> None:
        """Seed the environments and start all flights."""
        super().reset(seed)
        self._over[:] = False

    def run(self, seconds: float) -> Slice:
        """Step; resets do not count."""
        envs, actions = self._env, self._actions
        # counted after the measurement
        terminations: list[NDArray[np.bool_]] = []
        truncations: list[NDArray[np.bool_]] = []
        began = now = time.perf_counter()
        while now < began + seconds or len(terminations) < 2:  # a single step may only reset
            _, _, terminated, truncated, _ = envs.step(next(actions))
            terminations.append(terminated)
            truncations.append(truncated)
            now = time.perf_counter()
        over = np.vstack([self._over, np.logical_or(terminations, truncations)])
        self._over = over[-1].copy()
        return Slice(int((~over[:-1]).sum()), int(over[1:].sum()), now - began)


class ForBaselines(Driver):
    """Steps a `VecEnv` of Stable-Baselines3, which resets a flight in its last step."""

    def reset(self, seed: int) -> None:
        """Seed the environments and start all flights."""
        self._env.seed(seed)
        self._env.reset()
        self._env.reset()

    def run(self, seconds: float) -> Slice:
        """Step; each step counts."""
        envs, actions = self._env, self._actions
        ends: list[NDArray[np.bool_]] = []
        began = now = time.perf_counter()
        while now < began + seconds or not ends:
            _, _, done, _ = envs.step(next(actions))
            ends.append(done)
            now = time.perf_counter()
        return Slice(len(ends) * envs.num_envs, int(np.sum(ends)), now - began)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An environment to measure, and its driver."""

    name: str
    number: int
    """Number of environments that are stepped together."""
    make: Callable[[], AbstractContextManager[Any]]
    driver: Callable[[Any, NDArray[Any]], Driver]
    fields: int
    """Number of fields from which resets draw; 0 for CartPole."""
    share: bool = False
    """Whether all environments share the same prepared fields."""

    @property
    def missing(self) -> bool:
        """Whether it needs Stable-Baselines3, which is not installed."""
        return self.driver is ForBaselines and not has_baselines()

    def actions(self, rng: np.random.Generator) -> NDArray[Any]:
        """Actions (batches, number, ...), which are repeated."""
        size = (max(64, 2**14 // self.number), self.number)
        if not self.fields:
            return rng.integers(2, size=size)
        return np.clip(rng.normal(0.0, DEVIATION, (*size, 4)), -1.0, 1.0).astype(np.float32)

    def warm_up(self, driver: Driver, rng: np.random.Generator) -> None:
        """Compile, and prepare the fields.

        Each reset without a seed draws a block of fields for each environment. With ten draws per
        field, a field is missed with probability exp(-10).
        """
        draws = FIRST_BLOCK * (self.number if self.share else 1)
        for seed in rng.integers(2**31, size=1 + math.ceil(10 * self.fields / draws)).tolist():
            driver.reset(seed)


def has_baselines() -> bool:
    """Whether Stable-Baselines3 is installed."""
    return importlib.util.find_spec("stable_baselines3") is not None


def entries(observation: str, fields: int = FIELDS) -> list[Entry]:
    """The environments to measure, in the order of the table."""

    def pole(what: str, number: int, make: Any, driver: Any) -> Entry:
        name = "CartPole-v1"
        make = partial(make, name, number)
        return Entry(name=f"{name}{what}", number=number, make=make, driver=driver, fields=0)

    def ours(
        what: str, number: int, make: Any, driver: Any, share: bool = False, apart: int = 1
    ) -> Entry:
        return Entry(
            name=f"ObstacleField{what}",
            number=number,
            make=partial(make, number, observation=observation, fields=fields // apart),
            driver=driver,
            fields=fields // apart,
            share=share,
        )

    return [
        ours("", 1, partial(_scalar, ENVIRONMENT_ID), OneByOne),
        *(
            ours(" vector", number, partial(_vector, ENVIRONMENT_ID), Together, share=True)
            for number in (1, 16, 256, 2048)
        ),
        ours(" for SB3", 256, _adapter, ForBaselines, share=True),
        # each of the 16 has its own fields, together as many as the others
        ours(" SyncVectorEnv", 16, _one_after_another, Together, apart=16),
        ours(" SubprocVecEnv", 2, _in_processes, ForBaselines),
        pole("", 1, _scalar, OneByOne),
        pole(" vector", 256, _vector, Together),
        pole(" vector", 2048, _vector, Together),
    ]


def _make(**arguments: Any) -> gym.Env[Any, Any]:
    return gym.make(ENVIRONMENT_ID, **arguments)


def _scalar(name: str, _: int, **arguments: Any) -> AbstractContextManager[Any]:
    return closing(gym.make(name, **arguments))


def _vector(name: str, number: int, **arguments: Any) -> AbstractContextManager[Any]:
    mode = "vector_entry_point"
    return closing(gym.make_vec(name, number, vectorization_mode=mode, **arguments))


def _one_after_another(number: int, **arguments: Any) -> AbstractContextManager[Any]:
    return closing(SyncVectorEnv([partial(_make, **arguments)] * number))


def _adapter(number: int, **arguments: Any) -> AbstractContextManager[Any]:
    from agents.training.sb3_vec_env import ObstacleFieldVecEnv

    return closing(ObstacleFieldVecEnv(number, **arguments))


def _in_processes(number: int, **arguments: Any) -> AbstractContextManager[Any]:
    return in_processes([partial(_make, **arguments)] * number)
