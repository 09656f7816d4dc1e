"""The expert that flies along the way shown, for many states at once."""

from __future__ import annotations

import numpy as np
import pytest

from agents.training.imitation.way_expert import label
from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.simulation import Settings, SimulatedRollouts
from ferguson_gym.world import State, decode, get_field, initial_state
from planners.interface import State as PlanState
from planners.receding_horizon.pursuit import Pursuit
from planners.registry import make

SETTINGS = Settings(way=2, margin=0.8)


def rollouts(names: list[str], settings: Settings = SETTINGS) -> SimulatedRollouts:
    fields = [get_field(name) for name in names]
    return SimulatedRollouts(
        fields, np.arange(len(fields)), [initial_state(field) for field in fields], settings
    )


@pytest.mark.parametrize("suite", ["standard", "dense", "traps"])
def test_its_flights_arrive_within_two_percent_of_the_shortest(suite: str) -> None:
    names = [f"{suite}/train:{seed}" for seed in range(12)]
    flights = rollouts(names, Settings(way=2, margin=0.5))
    lengths = np.full(len(names), np.inf)
    while len(flights.active):
        actions, known = label(flights)
        assert known.all()
        flights.step(actions)
        assert (flights.flying | flights.arrived).all()
        lengths[flights.active[flights.arrived]] = flights.lengths[flights.arrived]
        flights.keep(flights.flying)
    exact = [exact_length(get_field(name)) for name in names]
    assert np.median(lengths / exact) < 1.02


def test_it_decides_as_pursuit_with_the_same_margin_does() -> None:
    names, planner = [f"standard/train:{seed}" for seed in range(6)], make("pursuit")
    assert isinstance(planner, Pursuit)
    flights = rollouts(names)
    for _ in range(8):
        actions, known = label(flights)
        assert known.all()
        for i, one in enumerate(flights.buffers.flights[known]):
            field = get_field(names[one["slot"]])
            vehicle = State(one["position"].copy(), one["derivative"].copy(), int(one["segments"]))
            chain = planner.decide(field, PlanState(vehicle), 0).chain
            assert chain is not None
            mine = decode(actions[known][i], vehicle.position, vehicle.derivative, field.goal, 1.0)
            np.testing.assert_allclose(mine[1], chain[0, 1], atol=0.05)
            np.testing.assert_allclose(mine[3], chain[0, 3], atol=0.5)
        flights.step(actions)


def test_where_no_segment_is_feasible_it_knows_nothing() -> None:
    field = get_field("standard/train:0")
    near = State(field.goal - [1.5, 0.0], np.array([7.0, 0.0]), 5)  # beyond the gate, too near
    flights = SimulatedRollouts([field], [0, 0], [near, initial_state(field)], SETTINGS)
    actions, known = label(flights)
    assert known.tolist() == [False, True]
    assert not actions[0].any()
