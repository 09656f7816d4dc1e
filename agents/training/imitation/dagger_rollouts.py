"""Rollouts of a learner with an expert's action in every visited state: the data of DAgger.

Reference:
    Ross, Gordon & Bagnell (2011), A reduction of imitation learning and structured prediction to
    no-regret online learning, AISTATS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor

from agents.models import torch_model
from agents.models.model_card import ModelCard, parse_card
from agents.models.torch_model import TorchModel
from agents.training.imitation.dataset import COLUMNS, labelled_row
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world import Field, Outcome, advance, encode, initial_state
from ferguson_gym.world import State as VehicleState
from ferguson_gym.world.actions import Action
from planners.interface import Replanner, State
from planners.registry import make

_HEADING_STD = 0.7
"""Standard deviation [rad] of a random state's heading around that of the shortest path."""
_SPEED_MEDIAN, _SPEED_STD = 7.0, 0.2
"""Median of a random state's speed [m per unit t], and standard deviation of its logarithm."""
_NEAR = 3
"""States marked as near a refused segment: the one where it was refused, and the two before."""
_STRIDE = 7.0
"""Length of the segments that a random state is assumed to have flown [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RolloutRequest:
    """What a worker process needs to collect rollouts."""

    card: ModelCard
    """Of the learner, as are the weights."""
    environment: dict[str, Any]
    """Arguments of the environment that is flown."""
    weights: dict[str, Tensor]
    expert: str
    """Name of a planner that decides step by step."""
    seeds: range
    """Of the fields; one rollout through each."""
    stream: tuple[int, ...]
    """Seed of the random numbers."""
    scattered: float
    """Share of the rollouts that start at a random state."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rollouts:
    """Labelled states of some rollouts."""

    rows: Array
    """(n, COLUMNS) states with the expert's actions; those of one field are adjacent."""
    steps: int
    """States visited."""
    refused: int
    """Segments of the learner that were refused; the expert's were flown in their place."""


def collect(request: RolloutRequest) -> Rollouts:
    """Fly the learner's most likely actions, and ask the expert in every state."""
    policy = _policy(request.card.to_json())
    policy.load_state_dict(request.weights)
    network = TorchModel(policy, request.card).model.network
    with network.session():
        return _collect(request, lambda seen: network.act({k: v[None] for k, v in seen.items()})[0])


def _collect(request: RolloutRequest, act: Callable[[Observation], Action]) -> Rollouts:
    planner, settings = _expert(request.expert), settings_of(request.environment)
    stream = np.random.default_rng(request.stream)
    rows: list[list[float]] = []
    steps = refused = 0
    for seed in request.seeds:
        field = settings.field(seed)
        scattered = stream.random() < request.scattered
        vehicle = random_state(field, stream) if scattered else initial_state(field)
        own: list[list[float]] = []
        outcome = Outcome.FLYING
        while outcome is Outcome.FLYING:
            label: Action | None = None
            chain = planner.decide(field, State(vehicle), 0).chain
            if chain is not None:
                unit = field.limits.unit
                label = encode(chain[0], vehicle.position, vehicle.derivative, unit)
                own.append(labelled_row(seed, vehicle, label))
            step = advance(field, vehicle, act(observe_one(field, vehicle, settings)))
            steps += 1
            if not step.flown:
                refused += 1
                for row in own[-_NEAR:]:
                    row[-1] = 1.0
                if label is not None:
                    step = advance(field, vehicle, label)
            vehicle, outcome = step.state, step.outcome
        rows += own
    return Rollouts(rows=np.array(rows).reshape(-1, COLUMNS), steps=steps, refused=refused)


def random_state(field: Field, stream: np.random.Generator) -> VehicleState:
    """A random state in free space, heading roughly along the shortest path to the goal."""
    togo = distance_to_go(field)
    while True:
        place = stream.uniform(field.bounds[0], field.bounds[1])
        distance, gradient = togo(place[None])
        if np.isfinite(distance[0]) and distance[0] > _STRIDE:
            break
    heading = -complex(*gradient[0]) * np.exp(1j * _HEADING_STD * stream.normal())
    velocity = _SPEED_MEDIAN * np.exp(_SPEED_STD * stream.normal()) * heading
    whole = float(np.linalg.norm(field.goal - field.start))
    flown = max(0, round((whole - float(distance[0])) / _STRIDE))
    return VehicleState(place, np.array([velocity.real, velocity.imag]), flown)


@lru_cache(maxsize=2)
def _policy(card: str) -> BasePolicy:
    return torch_model.build(parse_card(card))


@lru_cache(maxsize=1)
def _expert(name: str) -> Replanner:
    planner = make(name)
    assert isinstance(planner, Replanner)
    return planner
