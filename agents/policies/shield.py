"""The shield: an agent flies, and a planner replaces the segments that fail a check.

Before an agent's segment is flown, it is certified as in the environment, and a feasible segment
must be known from its end: the agent's own next one, or else the planner's. So a flight only enters
states with a certified next segment. Loitering is limited: only a few segments of a flight may fail
to approach the goal, and enough segments must remain for the planner to finish.

Guarantee: if, from the start and from every state that the shield accepted, the planner would reach
the goal with the remaining segments, then the shielded flight reaches the goal. The reason is that
every state of the flight either was accepted or lies on the planner's flight from an accepted
state, because the planner continues its own plan as it would alone. Limitation: the planner may
find no segment although one exists. Then the shield flies the continuation that it certified when
it accepted the state, and counts the step as unproven.

Reference:
    Alshiekh, Bloem, Ehlers, Könighofer, Niekum & Topcu (2018), Safe reinforcement learning via
    shielding, AAAI Conference on Artificial Intelligence.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agents.policies.interface import Policy
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.runtime import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.simulation import Observation, Settings, observe_one
from ferguson_gym.world import Action, Field, Outcome, encode, transition
from planners.interface import Decision, Knowledge, Replanner, State, WindowReport
from planners.receding_horizon import Guided
from planners.rollout import successor

PATIENCE = 3
"""Number of the agent's segments in one flight that may come no nearer to the goal."""
PACE = 9.0
"""Least progress towards the goal of a planner's segment [m]; in flights of `guided` all but the
last two segments exceed 10 m."""
RESERVE = 4
"""Segments kept in addition: for turning round, and for the shorter last segments."""
_SEEN = Settings()
"""The default settings of the environment, in which policies fly."""


@dataclass(frozen=True, slots=True, eq=False)
class _Proposal:
    """The agent's certified action in a state."""

    vehicle: transition.State
    action: Action | None
    step: transition.Step | None
    """The resulting step; None if the agent gave up."""

    @property
    def flies(self) -> bool:
        """Whether the agent's segment is feasible."""
        return self.step is not None and self.step.flown


class Shield:
    """A policy whose segments a planner replaces if they fail a check.

    In a flight without disturbances the agent acts once in each state: an action computed one
    step ahead is flown if the agent also decides the next step.
    """

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD
    """It measures progress by the exact distance to go, whatever the agent and planner know."""

    def __init__(self, agent: Policy, planner: Replanner | None = None) -> None:
        """Shield an agent; the planner is `guided` by default."""
        self._agent = agent
        self._planner: Replanner = Guided() if planner is None else planner
        self.shield_decisions: list[ShieldDecision] = []
        """How each step of the current flight was decided."""
        self.decisions: list[Decision] = []
        """The decisions themselves; an agent's chain is its segment, and the next one if known."""

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._agent.begin(field, seed)
        self._field, self._seed = field, seed
        self._last: tuple[State, Array] | None = None
        self._ahead: _Proposal | None = None
        self._next_decision: tuple[transition.State, Decision] | None = None
        self._nearest, self._wasted = math.inf, 0
        self.shield_decisions, self.decisions = [], []

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The agent's action if it passes the checks, else the planner's.

        None ends the flight: the planner finds no segment and the agent's is not feasible.

        Raises:
            TypeError: the field is not planar.
        """
        began = time.perf_counter()
        state = State(vehicle) if self._last is None else successor(*self._last, vehicle)
        self._measure(vehicle)
        proposal = self._ahead
        if proposal is None or not _same(proposal.vehicle, vehicle):
            proposal = self._ask(observation, vehicle)
        how = self._check(state, proposal)
        if how is not ShieldDecision.AGENT:
            decision = self._decide(state)
            if decision.chain is not None:
                self._last = state, decision.chain
                self._note(how, decision)
                unit = self._field.limits.unit
                return encode(decision.chain[0], vehicle.position, vehicle.derivative, unit)
            if not proposal.flies:
                self._note(ShieldDecision.STUCK, decision)
                return None
            how = ShieldDecision.UNPROVEN
        flown, chain = self._chains(proposal)
        self._last = state, flown
        seconds = time.perf_counter() - began
        report = WindowReport(step=vehicle.segments, start=how.label, seconds=seconds)
        self._note(how, Decision(chain, report))
        return proposal.action

    def _measure(self, vehicle: transition.State) -> None:
        """Update the minimum distance to the goal, and how often the agent did not approach it."""
        distance = self._distance(vehicle)
        if distance >= self._nearest and self.shield_decisions[-1:] == [ShieldDecision.AGENT]:
            self._wasted += 1
        self._nearest = min(distance, self._nearest)

    def _distance(self, vehicle: transition.State) -> float:
        """The length of the shortest path to the goal [m]; infinite without one."""
        (distance,), _ = distance_to_go(self._field)(vehicle.position[None])
        return float(distance)

    def _note(self, how: ShieldDecision, decision: Decision) -> None:
        self.shield_decisions.append(how)
        self.decisions.append(decision)

    def _ask(self, observation: Observation, vehicle: transition.State) -> _Proposal:
        action = self._agent.act(observation, vehicle)
        if action is None:
            return _Proposal(vehicle, None, None)
        step = transition.advance(self._field, vehicle, action)
        return _Proposal(vehicle, action, step)

    def _check(self, state: State, proposal: _Proposal) -> ShieldDecision:
        """Whether the agent decides a step, or why it does not."""
        step = proposal.step
        if step is None:
            return ShieldDecision.GAVE_UP
        if not step.flown:
            return ShieldDecision.INFEASIBLE
        if step.outcome is Outcome.GOAL_REACHED:
            return ShieldDecision.AGENT
        limits = self._field.limits
        left = limits.segments - step.state.segments
        distance = self._distance(step.state)
        if distance > PACE * limits.unit * (left - RESERVE):
            return ShieldDecision.RUNNING_OUT
        if distance >= self._nearest and self._wasted >= PATIENCE:
            return ShieldDecision.LOITERING
        end = successor(state, step.control[None], step.state)
        return ShieldDecision.AGENT if self._is_continuable(end) else ShieldDecision.NOT_CONTINUABLE

    def _is_continuable(self, end: State) -> bool:
        """Whether a feasible segment is known from a state; it is kept for the next step."""
        self._ahead = self._ask(observe_one(self._field, end.vehicle, _SEEN), end.vehicle)
        return self._ahead.flies or self._decide(end).chain is not None

    def _decide(self, state: State) -> Decision:
        """The planner's decision in a state, made now or when the state was checked."""
        if self._next_decision is None or not _same(self._next_decision[0], state.vehicle):
            decision = self._planner.decide(self._field, state, self._seed)
            self._next_decision = state.vehicle, decision
        return self._next_decision[1]

    def _chains(self, proposal: _Proposal) -> tuple[Array, Array]:
        """The agent's segment (1, 4, 2); the same with its next segment, if known (2, 4, 2)."""
        assert proposal.step is not None
        step, ahead = proposal.step, self._ahead
        flown = step.control[None]
        if ahead is None or ahead.step is None or not ahead.flies:
            return flown, flown
        if not _same(ahead.vehicle, step.state):
            return flown, flown
        return flown, np.stack([step.control, ahead.step.control])


def _same(one: transition.State, other: transition.State) -> bool:
    """Whether two states are equal to the last bit."""
    return (
        one.segments == other.segments
        and np.array_equal(one.position, other.position)
        and np.array_equal(one.derivative, other.derivative)
    )
