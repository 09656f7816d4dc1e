"""Planners as policies: one replans at every step, the other tracks a single plan."""

from __future__ import annotations

from agents.policies.interface import PlannerPolicy
from ferguson_gym.runtime import Array
from ferguson_gym.simulation import Observation
from ferguson_gym.world import Action, Field, encode, transition
from planners.interface import (
    Decision,
    Knowledge,
    Plan,
    Planner,
    Replanner,
    Route,
    State,
    knowledge_of,
)
from planners.rollout import successor


class ReplanningPolicy:
    """A receding-horizon planner as a policy: it decides again from each state that is reached."""

    route: Route | None = None

    def __init__(self, planner: Replanner) -> None:
        self._planner = planner
        self.decisions: list[Decision] = []

    @property
    def knows(self) -> Knowledge:
        """What its planner knows of a field."""
        return knowledge_of(self._planner)

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._field, self._seed = field, seed
        self._last: tuple[State, Array] | None = None
        self.decisions = []

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The action that flies the first segment of the planner's decision."""
        state = State(vehicle) if self._last is None else successor(*self._last, vehicle)
        decision = self._planner.decide(self._field, state, self._seed)
        self.decisions.append(decision)
        if decision.chain is None:
            return None
        self._last = state, decision.chain
        unit = self._field.limits.unit
        return encode(decision.chain[0], vehicle.position, vehicle.derivative, unit)


class TrackingPolicy:
    """A planner that plans once; its plan is then flown segment by segment."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self.decisions: list[Decision] = []
        self.route: Route | None = None

    @property
    def knows(self) -> Knowledge:
        """What its planner knows of a field."""
        return knowledge_of(self._planner)

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._field, self._seed = field, seed
        self._plan: Plan | None = None
        self.decisions, self.route = [], None

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The action that flies the plan's next segment; plans at the first call."""
        if self._plan is None:
            self._first = vehicle.segments
            self._plan = self._planner.plan(self._field, State(vehicle), self._seed)
            self.decisions, self.route = list(self._plan.decisions), self._plan.route
        step = vehicle.segments - self._first
        if step >= len(self._plan.control):
            return None
        unit = self._field.limits.unit
        return encode(self._plan.control[step], vehicle.position, vehicle.derivative, unit)


def planner_policy(planner: Planner) -> PlannerPolicy:
    """A planner as a policy: a replanner decides at every step, the plan of others is tracked."""
    return ReplanningPolicy(planner) if isinstance(planner, Replanner) else TrackingPolicy(planner)
