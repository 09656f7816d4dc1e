"""The interface of policies: what flies in the environment."""

from __future__ import annotations

from typing import Protocol

from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from planners.interface import Decision, Route


class Policy(Protocol):
    """Chooses actions in one flight at a time."""

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The next action, or None if the policy gives up."""


class Expert(Policy, Protocol):
    """A planner as a policy; it keeps what it decided for whoever looks on."""

    decisions: list[Decision]
    """Decisions of this flight so far."""
    route: Route | None
    """Where its plan came from, if it plans the whole path at once and has planned."""
