"""One demonstration: a flight in the environment with all of its transitions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import ferguson_gym
from agents.flights import StepData, fly
from agents.policies import Policy
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import INFOS
from ferguson_gym.world import Field, Outcome, State
from ferguson_gym.world.actions import Action

FLAT = "flat"
"""Name of an observation that is one vector."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Episode:
    """A flight of n segments."""

    field: str
    """Name of the field."""
    outcome: Outcome
    observations: Mapping[str, NDArray[np.float32]]
    """Entries (n + 1, size); `FLAT` alone from an environment with flat observations."""
    actions: Action
    """(n, 4); the next three are (n,)."""
    rewards: Array
    terminations: NDArray[np.bool_]
    truncations: NDArray[np.bool_]
    infos: Mapping[str, NDArray[Any]]
    """(n + 1,) by key; the first is from the reset."""


def make_environment(arguments: Mapping[str, Any]) -> gym.Env[Observation, Action]:
    """Make the environment that flights are recorded in.

    Raises:
        TypeError, ValueError: unknown or invalid arguments.
    """
    return gym.make(ferguson_gym.ENVIRONMENT_ID, **arguments)


def seed_of(field: str) -> int | None:
    """The seed of a field of a suite by its name; None for a field of the paper."""
    family, _, number = field.partition(":")
    return int(number) if "/" in family else None


def record(env: gym.Env[Observation, Action], field: str, policy: Policy) -> Episode:
    """Fly a policy with seed 0 through a field, to the end or until the policy gives up."""
    steps: list[StepData] = []
    flight = fly(policy, field, environment=env, on_step=steps.append)
    flown = steps[1:]
    seen: list[Any] = [step.observation for step in steps]
    if not isinstance(seen[0], Mapping):
        seen = [{FLAT: vector} for vector in seen]
    return Episode(
        field=field,
        outcome=flight.outcome,
        observations={key: np.stack([one[key] for one in seen]) for key in seen[0]},
        actions=np.array([step.action for step in flown], np.float32).reshape(-1, 4),
        rewards=np.array([step.reward for step in flown], np.float64),
        terminations=np.array([step.terminated for step in flown], np.bool_),
        truncations=np.array([step.truncated for step in flown], np.bool_),
        infos={key: np.array([step.info[key] for step in steps]) for key in INFOS},
    )


def replay(env: gym.Env[Observation, Action], field: str, actions: Action) -> Episode:
    """Fly recorded actions (n, 4) through a field; the flight may end before they do."""
    return record(env, field, _Recorded(actions))


@dataclass(slots=True)
class _Recorded:
    """A policy that repeats recorded actions."""

    actions: Action
    done: int = 0

    def begin(self, field: Field, seed: int) -> None:
        """Restart with the first action."""
        self.done = 0

    def act(self, observation: Observation, vehicle: State) -> Action | None:
        """The next action; None after the last."""
        self.done += 1
        return self.actions[self.done - 1] if self.done <= len(self.actions) else None


def pack(episodes: Sequence[Episode]) -> dict[str, NDArray[Any]]:
    """Concatenate episodes into arrays by name; none of them holds Python objects."""
    packed: dict[str, NDArray[Any]] = {
        "field": np.array([episode.field for episode in episodes], np.str_),
        "outcome": np.array([episode.outcome.code for episode in episodes], np.int64),
        "steps": np.array([len(episode.actions) for episode in episodes], np.int64),
    }
    for name in ("actions", "rewards", "terminations", "truncations"):
        packed[name] = np.concatenate([getattr(episode, name) for episode in episodes])
    for group in ("observations", "infos"):
        for key in getattr(episodes[0], group):
            parts = [getattr(episode, group)[key] for episode in episodes]
            packed[f"{group}/{key}"] = np.concatenate(parts)
    return packed


def unpack(packed: Mapping[str, NDArray[Any]]) -> Iterator[Episode]:
    """Episodes from arrays by name, as `pack` made them.

    Raises:
        KeyError: An array is missing.
        ValueError: An array has another length than `steps` says.
    """
    arrays = dict(packed)
    flights, total = len(arrays["steps"]), int(arrays["steps"].sum())
    for name, array in arrays.items():
        each = name in ("field", "outcome", "steps")
        wanted = flights if each else total + flights if "/" in name else total
        if len(array) != wanted:
            raise ValueError(f"{name} has {len(array)} rows instead of {wanted}")
    ends = np.cumsum(arrays["steps"])
    for i, (steps, end) in enumerate(zip(arrays["steps"], ends, strict=True)):
        rows = slice(end - steps, end)
        states = slice(end - steps + i, end + i + 1)

        def group(prefix: str, states: slice = states) -> dict[str, NDArray[Any]]:
            return {
                key.removeprefix(prefix): values[states]
                for key, values in arrays.items()
                if key.startswith(prefix)
            }

        yield Episode(
            field=str(arrays["field"][i]),
            outcome=Outcome.from_code(int(arrays["outcome"][i])),
            observations=group("observations/"),
            actions=arrays["actions"][rows],
            rewards=arrays["rewards"][rows],
            terminations=arrays["terminations"][rows],
            truncations=arrays["truncations"][rows],
            infos=group("infos/"),
        )
