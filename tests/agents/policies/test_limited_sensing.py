"""Agents with a limited sensing range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agents.flights import fly
from agents.policies import make_policy
from agents.policies.limited_sensing import SensingPolicy
from ferguson_gym.simulation import Observation
from ferguson_gym.world import Action, Field, Obstacles, State, encode, get_field
from planners.interface import Knowledge, knowledge_of
from planners.interface import State as PlanState
from planners.registry import make
from planners.wrappers.limited_sensing import Sensing, known_field

AGENT = "dagger"


class Watched:
    """Flies as an agent, and keeps the fields in which it began."""

    def __init__(self) -> None:
        self._agent, self.fields = make_policy(AGENT), []

    def begin(self, field: Field, seed: int) -> None:
        self.fields.append(field)
        self._agent.begin(field, seed)

    def act(self, observation: Observation, vehicle: State) -> Action | None:
        return self._agent.act(observation, vehicle)


def test_it_knows_what_a_planner_with_the_same_range_has_sensed() -> None:
    field, watched = get_field("standard/validation:4"), Watched()
    flight = fly(SensingPolicy(watched, 20.0), field)
    # states of the flight, as a planner gets them
    known = []
    for flown in range(len(flight.control)):
        control = flight.control[:flown]
        start = (field.start, field.start_derivative) if not flown else control[-1, [1, 3]]
        state = PlanState(State(*start, flown), flown=control)
        known.append(known_field(field, state, 20.0))
    different = [one for one, last in zip(known, [None, *known], strict=False) if one is not last]
    assert len(different) > 3
    assert [len(one.obstacles) for one in watched.fields[: len(different)]] == [
        len(one.obstacles) for one in different
    ]
    counts = [len(one.obstacles) for one in watched.fields]
    assert counts == sorted(counts)
    assert counts[-1] < len(field.obstacles)


def test_obstacles_out_of_range_change_nothing_and_near_ones_do() -> None:
    field = get_field("paper:2")
    policy = make_policy(f"{AGENT}+sensing=15")
    first = fly(policy, field).control[0]
    moved = field.obstacles.signed_distance(field.start) > 16.0
    assert moved.any()
    far = Field(name="far", obstacles=field.obstacles.only(~moved))
    np.testing.assert_array_equal(fly(policy, far).control[0], first)
    wall = Obstacles.discs([[9.0, 9.5]], [3.0])
    near = replace(field, obstacles=wall)
    assert not np.array_equal(fly(policy, near).control[0], first)


def test_a_range_beyond_the_field_is_no_limit() -> None:
    field = get_field("standard/validation:7")
    plain, wide = fly(make_policy(AGENT), field), fly(make_policy(f"{AGENT}+sensing=500"), field)
    np.testing.assert_array_equal(plain.control, wide.control)


def test_simulated_rollouts_know_no_more_than_the_agent() -> None:
    policy = make_policy(f"{AGENT}+tries=4+sensing=30")
    assert knowledge_of(policy) is Knowledge.NEARBY
    assert knowledge_of(make_policy(f"{AGENT}+tries=4")) is Knowledge.WHOLE_FIELD
    field = get_field("standard/validation:2")
    near = field.obstacles.signed_distance(field.start) <= 30.0
    without = replace(field, obstacles=field.obstacles.only(near))
    first = fly(policy, field).control[0]
    np.testing.assert_array_equal(fly(policy, without).control[0], first)


def test_a_range_below_the_longest_segment_is_refused() -> None:
    with pytest.raises(ValueError, match="at least the longest segment, 15 m"):
        fly(make_policy(f"{AGENT}+sensing=10"), get_field("paper:1"))


def test_planners_of_the_same_range_sense_the_same() -> None:
    planner = make("pursuit+sensing=25")
    assert isinstance(planner, Sensing)
    field = get_field("standard/validation:3")
    plan = planner.plan(field, PlanState(State(field.start, field.start_derivative, 0)), 0)
    assert plan.success

    class Repeats:
        """Flies the planner's segments."""

        def __init__(self) -> None:
            self.known: list[int] = []

        def begin(self, field: Field, seed: int) -> None:
            self.known.append(len(field.obstacles))

        def act(self, observation: Observation, vehicle: State) -> Action:
            segment = plan.control[vehicle.segments]
            return encode(segment, vehicle.position, vehicle.derivative)

    policy = Repeats()
    fly(SensingPolicy(policy, 25.0), field)
    sensed = [len(one.known.obstacles) for one in plan.decisions if one.known is not None]
    assert policy.known == sorted(set(sensed))


def test_states_that_a_flight_did_not_come_to_are_forgotten() -> None:
    field = get_field("standard/validation:4")
    states = [State(np.array([0.0, 8.0 * k]), np.array([0.0, 8.0]), k) for k in range(3)]
    aside = State(np.array([70.0, 70.0]), np.array([8.0, 0.0]), 1)  # imagined, say by a shield
    found = []
    for visited in ([states[0], aside, *states[1:]], states):
        watched = Watched()
        policy = SensingPolicy(watched, 20.0)
        policy.begin(field, 0)
        for state in visited:
            policy.act({}, state)
        found.append(watched.fields[-1].obstacles.centers)
    np.testing.assert_array_equal(*found)


def test_imagined_flights_sense_nothing() -> None:
    with pytest.raises(ValueError, match=r"nothing is sensed in them; leave \+sensing out"):
        make_policy(f"multi-start+from={AGENT}+sensing=20")
