"""Demonstrations in a replay buffer: an expert's flights, flown again as the learner sees them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.buffers import DictReplayBuffer

from agents.training.imitation.dataset import COLUMNS, row
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import as_field

_TOGETHER = 256
"""Flights that are flown again at a time."""


class Demonstrations(Protocol):
    """Flights one after the other, as `agents.demonstrations.reading.read` gives them."""

    @property
    def fields(self) -> Sequence[str]:
        """Names, one a flight."""

    @property
    def actions(self) -> Action:
        """(steps of all flights, 4)."""

    @property
    def offsets(self) -> NDArray[np.int64]:
        """(flights + 1,) flight i flew `actions[offsets[i] : offsets[i + 1]]`."""


class Transitions(NamedTuple):
    """N steps of flights, in no particular order."""

    seen: Observation
    """(N, size) of each entry."""
    then: Observation
    actions: Action
    """(N, 4)."""
    rewards: NDArray[np.float32]
    """(N,)."""
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


def read(dataset_id: str) -> Demonstrations:
    """The demonstrations of a dataset.

    Raises:
        ValueError: there is none, or it is of another environment.
    """
    demonstrations: Demonstrations = importlib.import_module("agents.demonstrations.reading").read(
        dataset_id
    )
    return demonstrations


def transitions(flights: Demonstrations, environment: Mapping[str, Any]) -> Iterator[Transitions]:
    """Fly demonstrations again in an environment with these arguments.

    An action is the same whatever is seen and however it is rewarded, so the recorded ones serve
    any of them.

    Raises:
        ValueError: an action that the environment refuses, or a flight that ends before its
            actions do.
    """
    number = len(flights.fields)
    for first in range(0, number, _TOGETHER):
        which = range(first, min(first + _TOGETHER, number))
        chosen = [as_field(flights.fields[i]) for i in which]
        room = max(
            settings_of(dict(environment)).max_obstacles, *(len(f.obstacles) for f in chosen)
        )
        envs = VectorObstacleField(
            len(which),
            autoreset_mode=AutoresetMode.DISABLED,
            **{**environment, "fields": 1, "capacity": room},
        )
        seen, _ = envs.reset(seed=0, options={"field": chosen})
        starts, ends = flights.offsets[which.start : which.stop], flights.offsets[first + 1 :]
        lengths = ends[: len(which)] - starts
        for step in range(int(lengths.max(initial=0))):
            busy = lengths > step
            actions = np.zeros((len(which), 4), np.float32)
            actions[busy] = flights.actions[starts[busy] + step]
            then, rewards, terminated, truncated, _ = envs.step(actions)
            ended = terminated | truncated
            if (early := ended & (lengths > step + 1)).any():
                name = chosen[int(np.flatnonzero(early)[0])].name
                raise ValueError(_ends_early(name))
            yield Transitions(
                {key: value[busy] for key, value in seen.items()},
                {key: value[busy] for key, value in then.items()},
                actions[busy],
                rewards[busy].astype(np.float32),
                terminated[busy],
                truncated[busy],
            )
            seen = then
            if ended.any():
                seen, _ = envs.reset(options={"reset_mask": ended, "field": chosen})


def rows(flights: Demonstrations) -> Iterator[tuple[Field, Array]]:
    """What demonstrations teach: the field and the lessons (n, COLUMNS) of each flight.

    Raises:
        ValueError: a flight that ends before its actions do.
    """
    for number, name in enumerate(flights.fields):
        field = as_field(name)
        vehicle, told = transition.initial_state(field), []
        for action in flights.actions[flights.offsets[number] : flights.offsets[number + 1]]:
            told.append(row(number, vehicle, action))
            step = transition.advance(field, vehicle, action)
            if not step.flown:
                raise ValueError(_ends_early(name))
            vehicle = step.state
        yield field, np.array(told).reshape(-1, COLUMNS)


def _ends_early(name: str) -> str:
    return (
        f"a demonstration in {name} ends before its last action: it is of another version of the "
        "environment, or this one has other limits"
    )


def fill(buffer: DictReplayBuffer, flights: Demonstrations, environment: Mapping[str, Any]) -> int:
    """Put demonstrations into a replay buffer, as far as there is room; returns how many steps.

    What the learner flies itself goes on behind them, and replaces them when the buffer is full.

    Raises:
        ValueError: as `transitions`; more steps than the buffer has room for.
    """
    room, width = buffer.buffer_size * buffer.n_envs, buffer.n_envs
    if len(flights.actions) > room:
        raise ValueError(
            f"{len(flights.actions)} steps of demonstrations, and room for {room} in the replay "
            "buffer: choose a larger buffer_size"
        )
    parts = list(transitions(flights, environment))
    whole = Transitions(
        _joined([part.seen for part in parts]),
        _joined([part.then for part in parts]),
        np.concatenate([part.actions for part in parts]),
        np.concatenate([part.rewards for part in parts]),
        np.concatenate([part.terminated for part in parts]),
        np.concatenate([part.truncated for part in parts]),
    )
    # rows of the buffer are as wide as there are environments: what is left over stays out
    number = len(whole.actions) // width * width
    for first in range(0, number, width):
        rows = slice(first, first + width)
        buffer.add(
            {key: value[rows] for key, value in whole.seen.items()},
            {key: value[rows] for key, value in whole.then.items()},
            whole.actions[rows],
            whole.rewards[rows],
            (whole.terminated | whole.truncated)[rows],
            [
                {"TimeLimit.truncated": bool(cut and not over)}
                for cut, over in zip(whole.truncated[rows], whole.terminated[rows], strict=True)
            ],
        )
    return number


def _joined(parts: Sequence[Observation]) -> Observation:
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
