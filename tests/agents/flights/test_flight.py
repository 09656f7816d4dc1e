"""One flight: a policy or its name, and the hook that sees each step."""

import gymnasium as gym
import numpy as np
import pytest

import ferguson_gym
from agents.flights import Flight, StepData, fly
from agents.policies.registry import make_policy
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.outcome import Outcome

FIELD = "sparse/train:0"


class Straight:
    """Flies straight ahead a few times, then gives up."""

    def __init__(self, steps: int) -> None:
        self._left = steps

    def begin(self, field: Field, seed: int) -> None:
        """Nothing to prepare."""

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """Straight ahead, until the steps are used up."""
        self._left -= 1
        return np.zeros(4, np.float32) if self._left >= 0 else None


def flight_and_steps(
    steps: int, environment: gym.Env | None = None
) -> tuple[Flight, list[StepData]]:
    seen: list[StepData] = []
    flown = fly(Straight(steps), FIELD, environment=environment, on_step=seen.append)
    return flown, seen


def test_the_hook_sees_the_reset_and_each_step() -> None:
    flown, seen = flight_and_steps(2)
    assert flown.outcome is Outcome.GAVE_UP
    assert flown.policy == "Straight"
    assert [step.action is None for step in seen] == [True, False, False]
    assert [step.state.segments for step in seen] == [step.info["segments"] for step in seen]
    np.testing.assert_array_equal(seen[0].state.position, get_field(FIELD).start)
    np.testing.assert_array_equal(seen[-1].state.position, flown.control[-1, 1])
    assert all(step.reward > 0.0 for step in seen[1:])
    assert not any(step.terminated or step.truncated for step in seen)


def test_a_policy_that_gives_up_at_once_flies_nothing() -> None:
    flown, seen = flight_and_steps(0)
    assert (len(flown.control), len(seen), flown.length) == (0, 1, 0.0)


def test_flights_in_a_wrapped_environment_are_the_same() -> None:
    environment = gym.make(ferguson_gym.ENVIRONMENT_ID, observation="discs")
    (plain, steps), (wrapped, others) = flight_and_steps(2), flight_and_steps(2, environment)
    np.testing.assert_array_equal(plain.control, wrapped.control)
    assert [step.reward for step in steps] == [step.reward for step in others]
    assert "obstacles" in others[0].observation
    assert "obstacles" not in steps[0].observation


def test_a_name_flies_the_policy_of_that_name() -> None:
    named, made = fly("pursuit", FIELD), fly(make_policy("pursuit"), get_field(FIELD))
    np.testing.assert_array_equal(named.control, made.control)
    assert named.policy == "pursuit"
    with pytest.raises(ValueError, match="unknown policy 'pursuits'"):
        fly("pursuits", FIELD)
