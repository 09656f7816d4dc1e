"""The interface of policies, which choose the actions of a flight."""

from __future__ import annotations

from typing import Protocol

from ferguson_gym.simulation import Observation
from ferguson_gym.world import Action, Field, transition
from planners.interface import Decision, Route


class Policy(Protocol):
    """Chooses actions in one flight at a time.

    A policy that uses only obstacles near the vehicle may state so as its attribute `knows`
    (`planners.interface.Knowledge`); one without it counts as knowing the whole field.
    """

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The next action, or None if the policy gives up."""


class PlannerPolicy(Policy, Protocol):
    """A planner as a policy, with a record of its decisions."""

    decisions: list[Decision]
    """Decisions of the current flight so far."""
    route: Route | None
    """The route that a whole-path planner's plan was fitted to; None before it has planned."""
