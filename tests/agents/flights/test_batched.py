"""Learned policies fly the same flights alone and in batches of any size."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch

from agents.flights.batched import fly_batch
from agents.flights.flight import fly
from agents.flights.metrics import score
from agents.models.model import Model
from agents.policies.lookahead import LookaheadPolicy
from agents.policies.network_policy import NetworkPolicy
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from tests.support.small_models import ALGORITHMS, DISCS, RAYS, learned

CROWDED = Field(
    name="crowded",
    obstacles=Obstacles.discs(np.random.default_rng(0).uniform(20, 90, (130, 2)), [2.0] * 130),
)
WAY = {**RAYS, "way": 3, "margin": 2.0, "progress": "way"}
FIELDS = [*get_fields("sparse/train:0-7"), *get_fields("traps/train:0-1"), CROWDED]


def model_of(algorithm: str, environment: dict) -> Model:
    """A model that flies some way before it ends."""
    return learned(algorithm, environment).model


@pytest.mark.parametrize(
    ("algorithm", "environment"), [*product(ALGORITHMS, (RAYS, DISCS)), ("ppo", WAY)]
)
def test_flights_are_the_same_alone_and_in_any_batch(algorithm: str, environment: dict) -> None:
    model = model_of(algorithm, environment)
    pilot = NetworkPolicy(model)
    alone = [fly(pilot, field, 0) for field in FIELDS]
    assert max(len(flight.control) for flight in alone) > 2
    for num in (1, 3, 7, 256):
        for mine, theirs in zip(fly_batch(model, FIELDS, num), alone, strict=True):
            np.testing.assert_array_equal(mine.control, theirs.control)
            assert mine.field is theirs.field
            assert mine.outcome is theirs.outcome
            assert mine.clearance == theirs.clearance
            assert (mine.length, mine.gap) == (theirs.length, theirs.gap)


def test_simulated_rollouts_show_the_way_too() -> None:
    model = model_of("ppo", WAY)
    alone = fly(NetworkPolicy(model), FIELDS[0], 0)
    best = fly(LookaheadPolicy(NetworkPolicy(model), 16), FIELDS[0], 0)
    assert len(best.control) >= len(alone.control) > 0


def test_scores_are_those_of_the_definitions() -> None:
    near = Field(name="near", obstacles=Obstacles.discs([], []), goal=[12.9, 12.9])
    far = Field(name="far", obstacles=Obstacles.discs([[20.0, 20.0]], [8.0]))
    straight = learned("ppo", RAYS)
    with torch.no_grad():
        for parameter in straight.policy.action_net.parameters():
            parameter.zero_()  # straight on: zero is 9 m ahead
    model = straight.model
    flights = fly_batch(model, [near, far, far], num=2)
    assert [flight.outcome for flight in flights] == [
        Outcome.GOAL_REACHED,
        Outcome.COLLISION,
        Outcome.COLLISION,
    ]
    found = score(flights)
    exact = exact_length(near)
    assert exact is not None
    assert found.flights == 3
    assert found.spl == pytest.approx(exact / max(flights[0].length, exact) / 3)
    assert found.gap == flights[0].gap
    assert found.success_low < found.success < found.success_high
    assert score(flights[1:]).gap is None
    assert score(flights[1:]).spl == 0.0


def test_nothing_is_flown_of_no_fields_and_none_without_room() -> None:
    model = model_of("ppo", RAYS)
    assert fly_batch(model, []) == []
    with pytest.raises(ValueError, match="need at least one flight at a time, got num=0"):
        fly_batch(model, FIELDS, num=0)
    with pytest.raises(ValueError, match="at least one trial"):
        score([])


def test_the_pilot_loads_a_model_once(tmp_path: Path) -> None:
    from agents.policies.network_policy import network_policy
    from tests.support.small_models import saved

    place = saved(tmp_path / "ace")
    assert network_policy(place).model is network_policy(place).model
    first = network_policy(place).model
    saved(place, seed=5)
    assert network_policy(place).model is not first
