"""Agents that simulate flights, with a network that flies straight at the goal."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import pytest

from agents.flights.flight import Flight, fly
from agents.models.model import Model
from agents.models.model_card import ModelCard
from agents.policies.lookahead import MOST, LookaheadPolicy
from agents.policies.network_policy import NetworkPolicy
from agents.policies.registry import make_policy
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome


class Straight:
    """Turns towards the goal, whatever stands in the way, and slows down before it."""

    def act(self, observation: Observation) -> Action:
        goal = observation["goal"]
        near = goal[:, 0] * 170.0 < 12.0
        turn = (0.2 * goal[:, 2]).clip(-0.5, 0.5)
        zero = np.zeros_like(turn)
        return np.stack([-0.2 - 0.2 * near, turn, zero, zero], axis=1).astype(np.float32)

    def session(self) -> AbstractContextManager[None]:
        return nullcontext()


PILOT = NetworkPolicy(
    Model(Straight(), ModelCard(algorithm="ppo", policy="mlp", policy_kwargs={}, environment={}))
)


def beside_the_way(depth: float) -> Field:
    """Two discs that reach over the diagonal by a depth [m]."""
    aside = (4.0 - depth) / np.sqrt(2.0)
    centers = np.array([[30.0 + aside, 30.0 - aside], [70.0 - aside, 70.0 + aside]])
    return Field(name=f"{depth} m deep", obstacles=Obstacles.discs(centers, np.array([4.0, 4.0])))


def among_corners(depth: float) -> Field:
    """Two squares that reach over the diagonal with a corner by a depth [m]."""
    corners = 4.0 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    aside = (4.0 * np.sqrt(2.0) - depth) / np.sqrt(2.0)
    middles = np.array([[30.0 + aside, 30.0 - aside], [70.0 - aside, 70.0 + aside]])
    squares = Obstacles.polygons(list(middles[:, None] + corners))
    return Field(name=f"corners {depth} m deep", obstacles=squares)


FIELDS = [beside_the_way(depth) for depth in (-0.5, -0.1, 0.1, 0.2, 0.4)]
CORNERS = [among_corners(depth) for depth in (-0.5, -0.1, 0.1, 0.2, 0.4)]


def flown(policy: Any, seed: int = 0, fields: Sequence[Field] = FIELDS) -> list[Flight]:
    return [fly(policy, field, seed) for field in fields]


@pytest.mark.parametrize("fields", [FIELDS, CORNERS], ids=["discs", "corners"])
def test_lookahead_arrives_more_often_and_never_by_a_longer_path(fields: list[Field]) -> None:
    alone, imagined = flown(PILOT, 0, fields), flown(LookaheadPolicy(PILOT, 24), 0, fields)
    assert 0 < sum(one.success for one in alone) < sum(one.success for one in imagined)
    for own, best in zip(alone, imagined, strict=True):
        if own.success:
            assert best.success
            assert best.length <= own.length + 1e-9


def test_the_seed_determines_the_simulated_flights() -> None:
    first, again, other = (flown(LookaheadPolicy(PILOT, 8), seed) for seed in (0, 0, 1))
    for one_, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(one_.control, same.control)
    assert any(
        a.control.shape != b.control.shape or (a.control != b.control).any()
        for a, b in zip(first, other, strict=True)
    )


def test_the_undisturbed_flight_is_flown_if_no_flight_arrives() -> None:
    field = Field(
        name="a wall", obstacles=Obstacles.discs(np.array([[50.0, 50.0]]), np.array([30.0]))
    )
    own, imagined = fly(PILOT, field, 0), fly(LookaheadPolicy(PILOT, 2), field, 0)
    assert own.outcome is imagined.outcome is Outcome.COLLISION
    np.testing.assert_array_equal(own.control, imagined.control)


def test_the_rest_is_simulated_again_from_an_unexpected_state() -> None:
    field = get_field("sparse/train:3")
    agent = LookaheadPolicy(PILOT, 8)
    agent.begin(field, 0)
    vehicle = transition.initial_state(field)
    action = agent.act({}, vehicle)
    assert action is not None
    there = transition.advance(field, vehicle, action).state
    moved = transition.State(there.position + 0.5, there.derivative, there.segments)
    fresh = LookaheadPolicy(PILOT, 8)
    fresh.begin(field, 0)
    expected = fresh.act({}, moved)
    given = agent.act({}, moved)
    assert expected is not None
    assert given is not None
    np.testing.assert_array_equal(given, expected)


@pytest.mark.parametrize("tries", [0, 1, MOST + 1])
def test_a_number_of_flights_out_of_range_is_an_error(tries: int) -> None:
    with pytest.raises(ValueError, match=f"simulates 2 to {MOST} rollouts, got {tries}"):
        LookaheadPolicy(PILOT, tries)


def test_an_unknown_agent_with_tries_is_an_error() -> None:
    with pytest.raises(ValueError, match="unknown policy"):
        make_policy("nobody+tries=8")
