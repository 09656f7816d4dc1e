"""Simulated rollouts fly as environments do, in several fields and from any states."""

from __future__ import annotations

import numpy as np
import pytest

from ferguson_gym import ObstacleField
from ferguson_gym.simulation import Settings, SimulatedRollouts, observe
from ferguson_gym.world import State, get_field, initial_state
from tests.support.scaled_fields import Motion

FIELDS = [
    get_field("standard/train:3"),
    get_field("paper:2"),
    Motion(scale=40.0).field(get_field("traps/train:1")),
]
VIEW = {"observation": "both", "nearest": 5, "rays": 7, "way": 3}
AHEAD = np.array([-0.1, 0.05, 0.0, 0.02], np.float32)
"""About 8 m ahead, a little to the left."""
TOO_SHORT = np.array([-0.99, 0.0, 0.0, 0.0], np.float32)


def test_flights_are_those_of_environments() -> None:
    which = np.array([0, 1, 2, 1])
    rollouts = SimulatedRollouts(
        FIELDS, which, [initial_state(FIELDS[k]) for k in which], Settings(**VIEW)
    )
    envs = [ObstacleField(**VIEW) for _ in which]
    seen = [env.reset(options={"field": FIELDS[k]})[0] for env, k in zip(envs, which, strict=True)]
    stream = np.random.default_rng(0)
    for _ in range(12):
        active = rollouts.active.tolist()
        for key, rows in rollouts.observations.items():
            np.testing.assert_array_equal(rows, [seen[i][key] for i in active])
        actions = AHEAD + stream.normal(0.0, 0.1, (len(active), 4)).astype(np.float32)
        rollouts.step(actions)
        for i, action in zip(active, actions, strict=True):
            seen[i], *_, info = envs[i].step(action)
            place = active.index(i)
            np.testing.assert_array_equal(rollouts.positions[place], envs[i].state.position)
            assert rollouts.lengths[place] == info["path_length"]
            assert rollouts.flying[place] == (info["outcome"] == 0)
        if not rollouts.flying.any():
            break
        rollouts.keep(rollouts.flying)
    assert len(rollouts.active) < len(which)  # some have ended, and the others flew on


def test_rollouts_begin_in_any_state_and_are_observed_in_other_settings() -> None:
    field = FIELDS[0]
    states = [
        State(np.array([30.0, 20.0]), np.array([3.0, 5.0]), 4),
        State(np.array([60.0, 70.0]), np.array([-2.0, 6.0]), 9),
    ]
    rollouts = SimulatedRollouts([field], [0, 0], states, Settings(**VIEW))
    other = Settings(observation="discs", nearest=4)
    for settings, found in (
        (Settings(**VIEW), rollouts.observations),
        (other, rollouts.observed(other)),
    ):
        expected = observe(field, states, settings)
        assert list(found) == list(expected)
        for key, rows in expected.items():
            np.testing.assert_array_equal(found[key], rows)


def test_another_action_is_flown_where_the_first_is_refused() -> None:
    states = [initial_state(FIELDS[0])] * 3
    rollouts = SimulatedRollouts(FIELDS[:1], [0, 0, 0], states, Settings(**VIEW))
    alone = SimulatedRollouts(FIELDS[:1], [0, 0, 0], states, Settings(**VIEW))
    refused = rollouts.step_or(
        np.stack([AHEAD, TOO_SHORT, TOO_SHORT]), np.stack([TOO_SHORT, AHEAD, TOO_SHORT])
    )
    assert refused.tolist() == [False, True, True]
    assert rollouts.flying.tolist() == [True, True, False]
    alone.step(np.stack([AHEAD, AHEAD, TOO_SHORT]))
    np.testing.assert_array_equal(rollouts.positions, alone.positions)
    np.testing.assert_array_equal(rollouts.lengths, alone.lengths)
    for key, rows in alone.observations.items():
        np.testing.assert_array_equal(rollouts.observations[key], rows)
    np.testing.assert_array_equal(rollouts.positions[2], FIELDS[0].start)


def test_a_state_without_segments_left_is_refused() -> None:
    late = State(FIELDS[0].start, FIELDS[0].start_derivative, 40)
    with pytest.raises(ValueError, match="cannot begin after 40 segments: none are left"):
        SimulatedRollouts(FIELDS[:1], [0], [late], Settings(**VIEW))
