"""Demonstrations in a replay buffer equal the steps of the scalar environment."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.buffers import DictReplayBuffer

from agents.training.imitation.demonstration_data import fill, transitions
from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.spaces import action_space, observation_space

ENVIRONMENT: dict[str, Any] = {"observation": "rays", "rays": 7, "detour": 2.0}


class Flights(NamedTuple):
    fields: tuple[str, ...]
    actions: np.ndarray
    offsets: np.ndarray


@pytest.fixture
def flights(tmp_path: Path) -> Flights:
    """Straight flights of two to four segments, to goals on their way."""
    names, actions = [], []
    for number in (3, 2, 4):
        goal = [number * 9.0 / 2**0.5] * 2
        path = tmp_path / f"{number}.json"
        crowd = {"centers": [[80.0, 5.0 + k / 10] for k in range(60)], "radii": [1.0] * 60}
        path.write_text(json.dumps({**crowd, "goal": goal}))
        names.append(str(path))
        actions.append(np.zeros((number, 4), np.float32))
    offsets = np.cumsum([0, *map(len, actions)])
    return Flights(tuple(names), np.concatenate(actions), offsets)


def flown(flights: Flights) -> list[tuple]:
    """Every step, in the scalar environment."""
    env, steps = ObstacleField(**ENVIRONMENT), []
    for i, name in enumerate(flights.fields):
        seen, _ = env.reset(seed=0, options={"field": name})
        for action in flights.actions[flights.offsets[i] : flights.offsets[i + 1]]:
            then, reward, terminated, truncated, _ = env.step(action)
            steps.append((seen, then, action, reward, terminated, truncated))
            seen = then
        assert terminated
    return steps


def key(seen: dict, reward: float) -> tuple:
    return (*seen["goal"].tolist(), *seen["rays"].tolist(), np.float32(reward).item())


def test_transitions_are_those_of_the_scalar_environment(flights: Flights) -> None:
    expected = {key(step[0], step[3]): step[1:3] for step in flown(flights)}
    found = 0
    for part in transitions(flights, ENVIRONMENT):
        for i in range(len(part.actions)):
            seen = {name: value[i] for name, value in part.observations.items()}
            then, action = expected.pop(key(seen, part.rewards[i]))
            for name, value in then.items():
                np.testing.assert_array_equal(part.next_observations[name][i], value)
            np.testing.assert_array_equal(part.actions[i], action)
            found += 1
    assert found == len(flights.actions)
    assert not expected


def test_a_buffer_is_filled_with_them(flights: Flights) -> None:
    space = observation_space(settings_of(ENVIRONMENT))
    buffer = DictReplayBuffer(20, space, action_space(), n_envs=2)
    assert fill(buffer, flights, ENVIRONMENT) == 8  # of 9: rows are two wide
    assert (buffer.pos, buffer.full) == (4, False)
    steps = flown(flights)
    rewards = sorted(np.float32(step[3]).item() for step in steps)
    assert set(buffer.rewards[:4].ravel().tolist()) <= set(rewards)
    assert 2 <= buffer.dones.sum() <= 3
    assert buffer.timeouts.sum() == 0
    with pytest.raises(ValueError, match="9 steps of demonstrations, and room for 6"):
        fill(DictReplayBuffer(6, space, action_space(), n_envs=2), flights, ENVIRONMENT)


def test_flights_of_another_version_are_refused(flights: Flights) -> None:
    wrong = Flights(flights.fields[::-1], flights.actions, flights.offsets)
    with pytest.raises(ValueError, match=r"a demonstration in .* ends before its last action"):
        list(transitions(wrong, ENVIRONMENT))
