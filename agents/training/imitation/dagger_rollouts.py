"""Rollouts of a learner with an expert's action in every visited state: the data of DAgger.

Reference:
    Ross, Gordon & Bagnell (2011), A reduction of imitation learning and structured prediction to
    no-regret online learning, AISTATS.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor

from agents.models import torch_model
from agents.models.model_card import ModelCard, parse_card
from agents.models.torch_model import TorchModel
from agents.training.imitation import way_expert
from agents.training.imitation.dataset import COLUMNS, Columns, observed
from agents.training.imitation.options import WAY_EXPERT
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.world import Field, encode, initial_state
from ferguson_gym.world import State as VehicleState
from ferguson_gym.world.actions import Action
from planners.interface import Replanner, State
from planners.registry import make

Expert: TypeAlias = Callable[[SimulatedRollouts], tuple[Action, NDArray[np.bool_]]]
"""Actions (n, 4) for the active rollouts, and for which of them it has one (n,)."""

_HEADING_STD = 0.7
"""Standard deviation [rad] of a random state's heading around that of the shortest path."""
_SPEED_MEDIAN, _SPEED_STD = 7.0, 0.2
"""Median of a random state's speed [units of the field per unit t], and standard deviation of its
logarithm."""
_NEAR = 3
"""States marked as near a refused segment: the one where it was refused, and the two before."""
_NOISE = 0.03
"""Standard deviation of the perturbations of an expert's action that is flown."""
_STRIDE = 7.0
"""Length of the segments that a random state is assumed to have flown [units of the field]."""


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
    follows: bool = False
    """Whether the expert's actions are flown, a little perturbed, since the learner knows nothing
    yet."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rollouts:
    """Labelled states of some rollouts."""

    rows: Array
    """(n, COLUMNS) states with the expert's actions; those of one field are adjacent."""
    columns: Columns
    """What samples hold of these states, as `agents.training.imitation.dataset.observed` says."""
    steps: int
    """States visited."""
    refused: int
    """Segments that were refused; where the expert has one, it was flown in their place."""


def collect(request: RolloutRequest) -> Rollouts:
    """Fly the learner's most likely actions, and ask the expert in every state."""
    policy = _policy(request.card.to_json())
    policy.load_state_dict(request.weights)
    network = TorchModel(policy, request.card).model.network
    with network.session():
        return _collect(request, network.act)


def _collect(request: RolloutRequest, act: Callable[[Observation], Action]) -> Rollouts:
    settings, stream = settings_of(request.environment), np.random.default_rng(request.stream)
    seeds = np.array(request.seeds)
    fields = [settings.field(seed) for seed in request.seeds]
    scattered = stream.random(len(fields)) < request.scattered
    if not fields:
        return Rollouts(rows=np.empty((0, COLUMNS)), columns={}, steps=0, refused=0)
    vehicles = [
        random_state(field, stream) if anywhere else initial_state(field)
        for field, anywhere in zip(fields, scattered.tolist(), strict=True)
    ]
    flights = SimulatedRollouts(fields, np.arange(len(fields)), vehicles, settings)
    label = _expert(request.expert, fields)
    rows, columns, labelled = list[Array](), list[Columns](), list[NDArray[np.bool_]]()
    while len(flights.active):
        labels, known = label(flights)
        actions = act(flights.observations)
        if request.follows:
            noise = _NOISE * stream.normal(size=labels.shape)
            perturbed = np.clip(labels + noise, -1.0, 1.0).astype(np.float32)
            actions = np.where(known[:, None], perturbed, actions)
        before = flights.buffers.flights.copy()
        columns.append(observed(flights, labels))
        labelled.append(known)
        active = flights.active
        refused = flights.step_or(actions, np.where(known[:, None], labels, actions))
        states = (
            before[key].reshape(len(active), -1) for key in ("position", "derivative", "segments")
        )
        rows.append(np.hstack([seeds[active][:, None], *states, labels, refused[:, None]]))
        flights.keep(flights.flying)
    return _in_order(np.concatenate(rows), columns, np.concatenate(labelled))


def _in_order(rows: Array, columns: Sequence[Columns], labelled: NDArray[np.bool_]) -> Rollouts:
    """Rollouts from the rows of all steps: flight after flight, states near refusals marked.

    Rows without a label are left out at the end, since a refusal there marks the states before it.
    """
    order = np.argsort(rows[:, 0], kind="stable")
    rows, labelled = rows[order], labelled[order]
    places = np.flatnonzero(rows[:, -1])
    for place in places:
        near = rows[max(0, place + 1 - _NEAR) : place + 1]
        near[near[:, 0] == rows[place, 0], -1] = 1.0
    return Rollouts(
        rows=rows[labelled],
        columns={
            key: np.concatenate([one[key] for one in columns])[order][labelled]
            for key in columns[0]
        },
        steps=len(rows),
        refused=len(places),
    )


def random_state(field: Field, stream: np.random.Generator) -> VehicleState:
    """A random state in free space, heading roughly along the shortest path to the goal."""
    togo, stride = distance_to_go(field), _STRIDE * field.limits.unit
    while True:
        place = stream.uniform(field.bounds[0], field.bounds[1])
        distance, gradient = togo(place[None])
        if np.isfinite(distance[0]) and distance[0] > stride:
            break
    heading = -complex(*gradient[0]) * np.exp(1j * _HEADING_STD * stream.normal())
    median = _SPEED_MEDIAN * field.limits.unit
    velocity = median * np.exp(_SPEED_STD * stream.normal()) * heading
    whole = float(np.linalg.norm(field.goal - field.start))
    flown = max(0, round((whole - float(distance[0])) / stride))
    at_most = field.limits.segments - 1
    return VehicleState(place, np.array([velocity.real, velocity.imag]), min(flown, at_most))


@lru_cache(maxsize=2)
def _policy(card: str) -> BasePolicy:
    return torch_model.build(parse_card(card))


def _expert(name: str, fields: Sequence[Field]) -> Expert:
    """The expert of this name for rollouts through some fields."""
    if name == WAY_EXPERT:
        return way_expert.label
    planner = _planner(name)

    def label(flights: SimulatedRollouts) -> tuple[Action, NDArray[np.bool_]]:
        states = flights.buffers.flights
        actions, known = np.zeros((len(states), 4), np.float32), np.zeros(len(states), np.bool_)
        for i, one in enumerate(states):
            here, ahead = one["position"].copy(), one["derivative"].copy()
            field, vehicle = fields[one["slot"]], VehicleState(here, ahead, int(one["segments"]))
            chain = planner.decide(field, State(vehicle), 0).chain
            if chain is not None:
                unit, known[i] = field.limits.unit, True
                actions[i] = encode(chain[0], here, ahead, unit)
        return actions, known

    return label


@lru_cache(maxsize=1)
def _planner(name: str) -> Replanner:
    planner = make(name)
    assert isinstance(planner, Replanner)
    return planner
