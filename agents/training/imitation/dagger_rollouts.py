"""Flights of a learner, and what an expert would do in every state that it visits.

Reference:
    Ross, Gordon & Bagnell (2011), A reduction of imitation learning and structured prediction to
    no-regret online learning, AISTATS: DAgger.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor

from agents.models import torch_model
from agents.models.model import Network
from agents.models.model_card import ModelCard, parse_card
from agents.models.torch_model import TorchModel
from agents.training.imitation.dataset import COLUMNS, row
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from planners.interface import Replanner, State
from planners.registry import make

_ASTRAY = 0.7
"""Standard deviation of a scattered flight's heading from the shortest way [rad]."""
_PACE = (7.0, 0.2)
"""Median of its speed [m per unit t], and standard deviation of the logarithm."""
_NEAR = 3
"""States that a failure is near to: the one where it happened, and those just before."""
_STRIDE = 7.0
"""Length of the segments that it is taken to have flown [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """Flights to be flown and watched."""

    card: ModelCard
    """Of the learner."""
    weights: dict[str, Tensor]
    expert: str
    """Name of a planner that decides step by step."""
    seeds: range
    """Of the fields; one flight through each."""
    stream: tuple[int, ...]
    """What the randomness is seeded with."""
    scattered: float
    """Share of the flights that begin anywhere in the field."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Visited:
    """What came of a visit."""

    rows: Array
    """Lessons (n, COLUMNS), those of one field one after the other."""
    steps: int
    """States that were visited."""
    failures: int
    """Steps of the learner that were refused; the expert's were flown in their place."""


class _Flight:
    """One of them, under way."""

    def __init__(self, seed: int, field: Field, vehicle: transition.State) -> None:
        self.seed, self.field, self.vehicle = seed, field, vehicle
        self.rows: list[list[float]] = []


def visit(asked: Visit) -> Visited:
    """Fly the learner by the actions it thinks best, and ask the expert in every state."""
    network = _network(asked)
    with network.session():
        return _visit(asked, network)


def _visit(asked: Visit, network: Network) -> Visited:
    planner = _expert(asked.expert)
    settings = settings_of(asked.card.environment)
    stream = np.random.default_rng(asked.stream)
    flights = []
    for seed in asked.seeds:
        field = settings.field(seed)
        scattered = stream.random() < asked.scattered
        vehicle = somewhere(field, stream) if scattered else transition.initial_state(field)
        flights.append(_Flight(seed, field, vehicle))
    steps = failures = 0
    for one in flights:
        over = False
        while not over:
            seen = observe_one(one.field, one.vehicle, settings)
            action = network.act({key: value[None] for key, value in seen.items()})[0]
            over, refused = _step(one, action, planner)
            steps, failures = steps + 1, failures + refused
    rows = [lesson for one in flights for lesson in one.rows]
    return Visited(rows=np.array(rows).reshape(-1, COLUMNS), steps=steps, failures=failures)


def _step(one: _Flight, action: Action, planner: Replanner) -> tuple[bool, bool]:
    """Write down what the expert would do, and fly on; is it over, and was the action refused?"""
    vehicle = one.vehicle
    lesson: Action | None = None
    chain = planner.decide(one.field, State(vehicle), 0).chain
    if chain is not None:
        lesson = encode(chain[0], vehicle.position, vehicle.derivative)
        one.rows.append(row(one.seed, vehicle, lesson))
    step = transition.advance(one.field, vehicle, action)
    refused = not step.flown
    if refused:
        for near in one.rows[-_NEAR:]:
            near[-1] = 1.0
    if refused and lesson is not None:
        step = transition.advance(one.field, vehicle, lesson)
    one.vehicle = step.state
    return step.outcome is not Outcome.FLYING, refused


def somewhere(field: Field, stream: np.random.Generator) -> transition.State:
    """A free place of a field anywhere, on the way to the goal or astray."""
    togo = distance_to_go(field)
    while True:
        place = stream.uniform(field.bounds[0], field.bounds[1])
        distance, gradient = togo(place[None])
        if np.isfinite(distance[0]) and distance[0] > _STRIDE:
            break
    way = -complex(*gradient[0]) * np.exp(1j * _ASTRAY * stream.normal())
    median, spread = _PACE
    slope = median * np.exp(spread * stream.normal()) * way
    whole = float(np.linalg.norm(field.goal - field.start))
    flown = max(0, round((whole - float(distance[0])) / _STRIDE))
    return transition.State(place, np.array([slope.real, slope.imag]), flown)


@lru_cache(maxsize=2)
def _learner_of(text: str) -> BasePolicy:
    return torch_model.build(parse_card(text))


def _network(asked: Visit) -> Network:
    """The learner as it flies; torch has one network as the card says for all of a process."""
    policy = _learner_of(asked.card.to_json())
    policy.load_state_dict(asked.weights)
    return TorchModel(policy, asked.card).model.network


@lru_cache(maxsize=1)
def _expert(name: str) -> Replanner:
    planner = make(name)
    assert isinstance(planner, Replanner)
    return planner
