"""An agent that imagines flights before it flies: its own, disturbed a little, and then the best.

The rules of flight are known, and so is the field; so an agent can try what it would do. What is
imagined is judged as the environment judges flights, so the best imagined flight is the one that
is flown. Nothing is planned or optimised: without its network there is nothing to imagine.

Reference:
    Chua, Calandra, McAllister & Levine (2018), Deep reinforcement learning in a handful of trials
    using probabilistic dynamics models, NeurIPS 31: trajectories are sampled through a model, and
    the best begins; here the model is exact and the samples are a policy's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agents.models import Model
from agents.pilots import Pilot
from ferguson_gym import flight
from ferguson_gym.actions import Action
from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.observations import Observation
from ferguson_gym.observing import observe
from ferguson_gym.outcome import Outcome

MOST = 1024
"""Flights that may be imagined at a time."""
SPREAD, LASTING = 0.05, 0.6
"""Standard deviation of disturbances of actions in the flight that is disturbed most, and how much
of a disturbance is left in the next action: what lasts leads other ways. Of several values the
best, for SPL on standard/train:5000000-5000149."""


@dataclass(slots=True, eq=False)
class _Try:
    """An imagined flight."""

    vehicle: flight.State
    spread: float
    """Standard deviation of what is added to its actions."""
    disturbance: Array
    """(4,) the last one, in parts of that."""
    actions: list[Action]
    length: float = 0.0
    """So far [m]."""


class Imagining:
    """A model as a policy that flies the shortest of the flights it imagines.

    The first is the model's own flight, the others are disturbed. If none arrives, the model's own
    is flown as far as it goes. Where a flight is not where it was imagined to be, because someone
    else decided a segment, the rest is imagined anew.

    Raises:
        ValueError: fewer than 2 flights, or more than `MOST`.
    """

    def __init__(self, pilot: Pilot, tries: int) -> None:
        if not 2 <= tries <= MOST:
            raise ValueError(f"an agent imagines 2 to {MOST} flights, got {tries}")
        self._model, self._tries = pilot.model, tries

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field; disturbances are drawn from the seed."""
        self._field, self._seed = field, seed
        self._ahead: list[Action] = []
        self._expected: flight.State | None = None

    def act(self, observation: Observation, vehicle: flight.State) -> Action | None:
        """The next action (4,) of the best flight; None if none is left of one that fails."""
        if self._expected is None or not _same(self._expected, vehicle):
            stream = np.random.default_rng((self._seed, vehicle.segments))
            self._ahead = imagine(self._model, self._field, vehicle, self._tries, stream)
        if not self._ahead:
            return None
        action = self._ahead.pop(0)
        self._expected = flight.advance(self._field, vehicle, action).state
        return action


def imagine(
    model: Model,
    field: Field,
    vehicle: flight.State,
    tries: int,
    stream: np.random.Generator,
) -> list[Action]:
    """The actions of the shortest of some flights from a state to the goal.

    Args:
        model: flies them.
        field: where.
        vehicle: where they begin.
        tries: how many.
        stream: of the disturbances.

    Returns:
        Those of the undisturbed flight, as far as it went, if none arrives.
    """
    spreads = np.linspace(0.0, SPREAD, tries)
    flights = [_Try(vehicle, spread, np.zeros(4), []) for spread in spreads.tolist()]
    own, best = flights[0], None
    while flights:
        seen = observe(field, [one.vehicle for one in flights], model.settings)
        fresh = stream.normal(size=(len(flights), 4))
        actions = model.network.act(seen)
        for one, action, new in zip(flights, actions, fresh, strict=True):
            one.disturbance = LASTING * one.disturbance + math.sqrt(1.0 - LASTING**2) * new
            action += one.spread * one.disturbance
        actions = np.clip(actions, -1.0, 1.0)
        steps = flight.advance_all(field, [one.vehicle for one in flights], actions)
        left = []
        for one, action, step in zip(flights, actions, steps, strict=True):
            one.actions.append(action)
            one.length += float(step.inspection.length)
            if step.outcome is Outcome.GOAL_REACHED:
                best = one if best is None or one.length < best.length else best
            elif step.outcome is Outcome.FLYING and (best is None or one.length < best.length):
                one.vehicle = step.state
                left.append(one)
        flights = left
    return (own if best is None else best).actions


def _same(one: flight.State, other: flight.State) -> bool:
    return one.segments == other.segments and np.array_equal(one.position, other.position)
