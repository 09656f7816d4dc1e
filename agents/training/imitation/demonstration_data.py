"""Demonstrations as training data: transitions for a replay buffer, or labelled states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.buffers import DictReplayBuffer

from agents.demonstrations import Demonstrations
from agents.training.imitation.dataset import COLUMNS, labelled_row
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world import Field, advance, initial_state
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field_names import as_field

_TOGETHER = 256
"""Flights that are replayed at a time."""


class Transitions(NamedTuple):
    """N steps of flights, in no particular order."""

    observations: Observation
    """Entries (N, size)."""
    next_observations: Observation
    actions: Action
    """(N, 4)."""
    rewards: NDArray[np.float32]
    """(N,)."""
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


def transitions(flights: Demonstrations, environment: Mapping[str, Any]) -> Iterator[Transitions]:
    """Replay demonstrations in an environment with these arguments.

    An action encodes the same segment whatever the observation and the reward are, so recorded
    actions serve any settings.

    Raises:
        ValueError: an action that the environment refuses, or a flight that ends before its
            actions do.
    """
    number = len(flights.fields)
    for first in range(0, number, _TOGETHER):
        which = range(first, min(first + _TOGETHER, number))
        chosen = [as_field(flights.fields[i]) for i in which]
        most = settings_of(dict(environment)).max_obstacles
        room = max(most, *(len(field.obstacles) for field in chosen))
        arguments = {**environment, "fields": 1, "capacity": room}
        envs = VectorObstacleField(len(which), autoreset_mode=AutoresetMode.DISABLED, **arguments)
        observations, _ = envs.reset(seed=0, options={"field": chosen})
        starts, ends = flights.offsets[which.start : which.stop], flights.offsets[first + 1 :]
        lengths = ends[: len(which)] - starts
        for step in range(int(lengths.max(initial=0))):
            busy = lengths > step
            actions = np.zeros((len(which), 4), np.float32)
            actions[busy] = flights.actions[starts[busy] + step]
            following, rewards, terminated, truncated, _ = envs.step(actions)
            ended = terminated | truncated
            if (early := ended & (lengths > step + 1)).any():
                raise ValueError(_ends_early(chosen[int(early.argmax())].name))
            yield Transitions(
                {key: value[busy] for key, value in observations.items()},
                {key: value[busy] for key, value in following.items()},
                actions[busy],
                rewards[busy].astype(np.float32),
                terminated[busy],
                truncated[busy],
            )
            observations = following
            if ended.any():
                observations, _ = envs.reset(options={"reset_mask": ended, "field": chosen})


def labelled_rows(flights: Demonstrations) -> Iterator[tuple[Field, Array]]:
    """The field of each flight, and its states with the actions flown there as (n, COLUMNS) rows.

    Raises:
        ValueError: a flight that ends before its actions do.
    """
    for number, name in enumerate(flights.fields):
        field = as_field(name)
        vehicle, rows = initial_state(field), []
        for action in flights.flight(number):
            rows.append(labelled_row(number, vehicle, action))
            step = advance(field, vehicle, action)
            if not step.flown:
                raise ValueError(_ends_early(name))
            vehicle = step.state
        yield field, np.array(rows).reshape(-1, COLUMNS)


def _ends_early(name: str) -> str:
    return (
        f"a demonstration in {name} ends before its last action: it is of another version of the "
        "environment, or this one has other limits"
    )


def fill(buffer: DictReplayBuffer, flights: Demonstrations, environment: Mapping[str, Any]) -> int:
    """Replay demonstrations into a replay buffer; returns the number of steps added.

    The learner's own steps follow behind them, and replace them when the buffer is full.

    Raises:
        ValueError: as `transitions`, or more steps than the buffer has room for.
    """
    room, width = buffer.buffer_size * buffer.n_envs, buffer.n_envs
    if len(flights.actions) > room:
        raise ValueError(
            f"{len(flights.actions)} steps of demonstrations, and room for {room} in the replay "
            "buffer: choose a larger buffer_size"
        )
    parts = list(transitions(flights, environment))
    whole = Transitions(
        _concatenate([part.observations for part in parts]),
        _concatenate([part.next_observations for part in parts]),
        np.concatenate([part.actions for part in parts]),
        np.concatenate([part.rewards for part in parts]),
        np.concatenate([part.terminated for part in parts]),
        np.concatenate([part.truncated for part in parts]),
    )
    # a row of the buffer has one step for each environment; an incomplete last row is left out
    number = len(whole.actions) // width * width
    for first in range(0, number, width):
        rows = slice(first, first + width)
        buffer.add(
            {key: value[rows] for key, value in whole.observations.items()},
            {key: value[rows] for key, value in whole.next_observations.items()},
            whole.actions[rows],
            whole.rewards[rows],
            (whole.terminated | whole.truncated)[rows],
            [
                {"TimeLimit.truncated": bool(truncated and not terminated)}
                for truncated, terminated in zip(
                    whole.truncated[rows], whole.terminated[rows], strict=True
                )
            ],
        )
    return number


def _concatenate(parts: Sequence[Observation]) -> Observation:
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
