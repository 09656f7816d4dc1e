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
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from agents.models.model import Model
from agents.policies.network_policy import NetworkPolicy
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field

MOST = 1024
"""Flights that may be imagined at a time."""
SPREAD, LASTING = 0.05, 0.6
"""Standard deviation of disturbances of actions in the flight that is disturbed most, and how much
of a disturbance is left in the next action: what lasts leads other ways. Of several values the
best, for SPL on standard/train:5000000-5000149."""

Leg: TypeAlias = tuple[Action, Array]
"""An action (4,), and where it ends (2,) [m]."""


class LookaheadPolicy:
    """A model as a policy that flies the shortest of the flights it imagines.

    The first is the model's own flight, the others are disturbed. If none arrives, the model's own
    is flown as far as it goes. Where a flight is not where it was imagined to be, because someone
    else decided a segment, the rest is simulated again.

    Raises:
        ValueError: fewer than 2 flights, or more than `MOST`.
    """

    def __init__(self, pilot: NetworkPolicy, tries: int) -> None:
        if not 2 <= tries <= MOST:
            raise ValueError(f"an agent imagines 2 to {MOST} flights, got {tries}")
        self._model, self._tries = pilot.model, tries
        self._settings = pilot.model.settings

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field; disturbances are drawn from the seed."""
        self._field, self._seed = field, seed
        self._ahead: list[Leg] = []
        self._expected: tuple[int, Array] | None = None

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The next action (4,) of the best flight; None if none is left of one that fails."""
        if self._expected is None or not _there(self._expected, vehicle):
            stream = np.random.default_rng((self._seed, vehicle.segments))
            self._ahead = imagine(
                self._model, self._settings, self._field, vehicle, self._tries, stream
            )
        if not self._ahead:
            return None
        action, end = self._ahead.pop(0)
        self._expected = vehicle.segments + 1, end
        return action


def _there(expected: tuple[int, Array], vehicle: transition.State) -> bool:
    segments, position = expected
    return vehicle.segments == segments and np.array_equal(vehicle.position, position)


def imagine(
    model: Model,
    settings: Settings,
    field: Field,
    vehicle: transition.State,
    tries: int,
    stream: np.random.Generator,
) -> list[Leg]:
    """The shortest of some flights from a state to the goal.

    Args:
        model: flies them.
        settings: of the environment that the model knows.
        field: where.
        vehicle: where they begin.
        tries: how many.
        stream: of the disturbances.

    Returns:
        The undisturbed flight, as far as it went, if none arrives.
    """
    flights = SimulatedRollouts(field, vehicle, tries, settings)
    spreads = np.linspace(0.0, SPREAD, tries)[:, None]
    disturbances = np.zeros((tries, 4))
    flown: list[tuple[NDArray[np.int64], Action, Array]] = []
    best, shortest = 0, math.inf
    while len(which := flights.which):
        fresh = stream.normal(size=(len(which), 4))
        disturbances = LASTING * disturbances + math.sqrt(1.0 - LASTING**2) * fresh
        actions = model.network.act(flights.seen) + spreads[which] * disturbances
        single = np.clip(actions, -1.0, 1.0).astype(np.float32)
        flights.step(single)
        flown.append((which, single, flights.ends.copy()))
        arrived = np.flatnonzero(flights.arrived)
        if len(arrived):
            first = arrived[np.argmin(flights.lengths[arrived])]
            if flights.lengths[first] < shortest:
                best, shortest = which[first], float(flights.lengths[first])
        promising = flights.flying & (flights.lengths < shortest)
        flights.keep(promising)
        disturbances = disturbances[promising]
    return [
        (actions[place], ends[place])
        for which, actions, ends in flown
        for place in np.flatnonzero(which == best)
    ]
