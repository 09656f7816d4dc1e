"""An agent that simulates rollouts before it flies, and flies the shortest that succeeds.

The rollouts are the agent's own, with perturbed actions. The dynamics and the field are known
exactly, and the simulation checks rollouts as the environment does, so the flight reproduces the
chosen rollout exactly. Nothing is planned or optimised: all rollouts come from the network.

Reference:
    Chua, Calandra, McAllister & Levine (2018), Deep reinforcement learning in a handful of trials
    using probabilistic dynamics models, NeurIPS 31, who sample trajectories through a learned
    model and execute the best; here the model is exact and the samples come from a policy.
"""

from __future__ import annotations

import math
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from agents.models.model import Model
from agents.policies.network_policy import NetworkPolicy
from ferguson_gym.runtime import Array
from ferguson_gym.simulation import Observation, Settings, SimulatedRollouts
from ferguson_gym.world import Action, Field, transition
from planners.interface import Knowledge

MOST = 1024
"""Upper limit of the number of rollouts."""
SPREAD, LASTING = 0.05, 0.6
"""Largest standard deviation of the perturbations of actions, and their correlation from one
action to the next: correlated perturbations explore other ways around obstacles. Of several values
these gave the highest SPL on standard/train:5000000-5000149."""

Leg: TypeAlias = tuple[Action, Array]
"""An action (4,), and the end point (2,) of its segment [m]."""


class LookaheadPolicy:
    """A model as a policy that flies the shortest of its rollouts.

    The first rollout has the model's own actions, the others have perturbed ones. If no rollout
    succeeds, the first is flown as far as it goes. In a state other than the simulated one, for
    example after a shield has replaced a segment, the remaining flight is simulated again.

    Raises:
        ValueError: fewer than 2 rollouts, or more than `MOST`.
    """

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD
    """Rollouts are checked against all obstacles."""

    def __init__(self, policy: NetworkPolicy, tries: int) -> None:
        if not 2 <= tries <= MOST:
            raise ValueError(f"an agent simulates 2 to {MOST} rollouts, got {tries}")
        self._model, self._tries = policy.model, tries
        self._settings = policy.model.settings

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field; perturbations are drawn from the seed."""
        self._field, self._seed = field, seed
        self._ahead: list[Leg] = []
        self._expected: tuple[int, Array] | None = None

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The next action (4,) of the best rollout; None at the end of a rollout that fails."""
        if self._expected is None or not (
            vehicle.segments == self._expected[0]
            and np.array_equal(vehicle.position, self._expected[1])
        ):
            stream = np.random.default_rng((self._seed, vehicle.segments))
            self._ahead = shortest_rollout(
                self._model, self._settings, self._field, vehicle, self._tries, stream
            )
        if not self._ahead:
            return None
        action, end = self._ahead.pop(0)
        self._expected = vehicle.segments + 1, end
        return action


def shortest_rollout(
    model: Model,
    settings: Settings,
    field: Field,
    vehicle: transition.State,
    tries: int,
    stream: np.random.Generator,
) -> list[Leg]:
    """The shortest of several rollouts from a state to the goal.

    Args:
        model: chooses the actions, which are then perturbed.
        settings: of the environment that the model was trained in.
        field: the field that is flown.
        vehicle: initial state.
        tries: number of rollouts.
        stream: draws the perturbations.

    Returns:
        Its legs; if no rollout succeeds, those of the unperturbed one.
    """
    flights = SimulatedRollouts([field], np.zeros(tries, np.int64), [vehicle] * tries, settings)
    spreads = np.linspace(0.0, SPREAD, tries)[:, None]
    perturbations = np.zeros((tries, 4))
    flown: list[tuple[NDArray[np.int64], Action, Array]] = []
    best, shortest = 0, math.inf
    while len(which := flights.active):
        fresh = stream.normal(size=(len(which), 4))
        perturbations = LASTING * perturbations + math.sqrt(1.0 - LASTING**2) * fresh
        actions = model.network.act(flights.observations) + spreads[which] * perturbations
        single = np.clip(actions, -1.0, 1.0).astype(np.float32)
        flights.step(single)
        flown.append((which, single, flights.positions.copy()))
        arrived = np.flatnonzero(flights.arrived)
        if len(arrived):
            first = arrived[np.argmin(flights.lengths[arrived])]
            if flights.lengths[first] < shortest:
                best, shortest = which[first], float(flights.lengths[first])
        promising = flights.flying & (flights.lengths < shortest)
        flights.keep(promising)
        perturbations = perturbations[promising]
    return [
        (actions[place], ends[place])
        for which, actions, ends in flown
        for place in np.flatnonzero(which == best)
    ]
