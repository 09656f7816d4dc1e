"""The shield: an agent flies, and what is doubtful of it a planner decides.

Before an agent's segment is flown it is certified as the environment does, and its end must be a
state from which a feasible segment is known: the agent's own next one, or else the planner's. So
a flight never enters a state without a certified way on, looked at one segment ahead. An agent
that loiters is stopped: some segments of a flight may lead no nearer to the goal than it was
before, and those that are left must always be ample for the planner.

What is guaranteed: if the planner's flight from every state that was accepted, and from the
start, arrives with the segments left there, the shielded flight arrives. For every state is
accepted or lies on the planner's flight from one that was: the planner goes on from its own plan
as it would alone. What is left over: a planner may find nothing where there is a way on. Then the
certified segment by which the state was accepted is flown all the same, and counted as unproven.

Reference:
    Alshiekh, Bloem, Ehlers, Könighofer, Niekum & Topcu (2018), Safe reinforcement learning via
    shielding, AAAI Conference on Artificial Intelligence.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from agents.policies.interface import Policy
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from planners.interface import Decision, Replanner, State, WindowReport
from planners.receding_horizon.guided import Guided
from planners.rollout import successor

PATIENCE = 3
"""Segments of the agent's, in one flight, that need not lead nearer to the goal than it was."""
PACE = 9.0
"""Way to the goal that a planner's segment covers at least [m]: on flights of `guided` it is more
than 10 m, but for the last two segments."""
RESERVE = 4
"""Segments kept beside those, to turn round and for the last ones, which are shorter."""
_SEEN = Settings()
"""The environment's own, in which policies are flown."""


@dataclass(frozen=True, slots=True, eq=False)
class _Proposal:
    """What the agent would do in a state, certified."""

    vehicle: transition.State
    action: Action | None
    step: transition.Step | None
    """Where that leads; None if the agent gave up."""

    @property
    def flies(self) -> bool:
        """Whether its segment is feasible."""
        return self.step is not None and self.step.flown


class Shield:
    """A policy under the eyes of a planner.

    In a flight that nothing disturbs the agent is asked once in each state: what it was asked
    ahead is flown if the next step is left to it.
    """

    def __init__(self, agent: Policy, planner: Replanner | None = None) -> None:
        """`guided` takes over where no other planner is given."""
        self._agent = agent
        self._planner: Replanner = Guided() if planner is None else planner
        self.shield_decisions: list[ShieldDecision] = []
        """Who decided the steps of this flight so far."""
        self.decisions: list[Decision] = []
        """What was decided in them; the agent's as its segment, and the next if it was asked."""

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._agent.begin(field, seed)
        self._field, self._seed = field, seed
        self._last: tuple[State, Array] | None = None
        self._ahead: _Proposal | None = None
        self._way_on: tuple[transition.State, Decision] | None = None
        self._nearest, self._wasted = math.inf, 0
        self.shield_decisions, self.decisions = [], []

    def act(self, observation: Observation, vehicle: transition.State) -> Action | None:
        """The agent's action if it passes the check, else the planner's.

        None, which ends the flight, where the planner finds nothing and the agent's segment is
        not feasible.

        Raises:
            TypeError: a field of other obstacles than discs in the plane.
        """
        began = time.perf_counter()
        state = State(vehicle) if self._last is None else successor(*self._last, vehicle)
        self._measure(vehicle)
        proposal = self._proposal(observation, vehicle)
        hand = self._hand(state, proposal)
        if hand is not ShieldDecision.AGENT:
            decision = self._decide(state)
            if decision.chain is not None:
                self._last = state, decision.chain
                self._note(hand, decision)
                return encode(decision.chain[0], vehicle.position, vehicle.derivative)
            if not proposal.flies:
                self._note(ShieldDecision.STUCK, decision)
                return None
            hand = ShieldDecision.UNPROVEN
        flown, meant = self._meant(proposal)
        self._last = state, flown
        seconds = time.perf_counter() - began
        report = WindowReport(step=vehicle.segments, start=hand.label, seconds=seconds)
        self._note(hand, Decision(meant, report))
        return proposal.action

    def _measure(self, vehicle: transition.State) -> None:
        """Note how near to the goal the flight was, and how often the agent led no nearer."""
        distance = self._distance(vehicle)
        if distance >= self._nearest and self.shield_decisions[-1:] == [ShieldDecision.AGENT]:
            self._wasted += 1
        self._nearest = min(distance, self._nearest)

    def _distance(self, vehicle: transition.State) -> float:
        """The length of the shortest path to the goal [m]; infinite without one."""
        (distance,), _ = distance_to_go(self._field)(vehicle.position[None])
        return float(distance)

    def _note(self, hand: ShieldDecision, decision: Decision) -> None:
        self.shield_decisions.append(hand)
        self.decisions.append(decision)

    def _proposal(self, observation: Observation, vehicle: transition.State) -> _Proposal:
        """What the agent proposes; it is asked now, or was asked ahead."""
        if self._ahead is not None and _same(self._ahead.vehicle, vehicle):
            return self._ahead
        return self._ask(observation, vehicle)

    def _ask(self, observation: Observation, vehicle: transition.State) -> _Proposal:
        action = self._agent.act(observation, vehicle)
        if action is None:
            return _Proposal(vehicle, None, None)
        step = transition.advance(self._field, vehicle, action, self._planner.limits)
        return _Proposal(vehicle, action, step)

    def _hand(self, state: State, proposal: _Proposal) -> ShieldDecision:
        """In whose hands a step is."""
        step = proposal.step
        if step is None:
            return ShieldDecision.GAVE_UP
        if not step.flown:
            return ShieldDecision.INFEASIBLE
        if step.outcome is Outcome.GOAL_REACHED:
            return ShieldDecision.AGENT
        left = self._planner.limits.segments - step.state.segments
        distance = self._distance(step.state)
        if distance > PACE * (left - RESERVE):
            return ShieldDecision.RUNNING_OUT
        if distance >= self._nearest and self._wasted >= PATIENCE:
            return ShieldDecision.LOITERING
        end = successor(state, step.control[None], step.state)
        return ShieldDecision.AGENT if self._goes_on(end) else ShieldDecision.NOT_CONTINUABLE

    def _goes_on(self, end: State) -> bool:
        """Whether a feasible segment is known from a state; the next step uses what was found."""
        self._ahead = self._ask(observe_one(self._field, end.vehicle, _SEEN), end.vehicle)
        return self._ahead.flies or self._decide(end).chain is not None

    def _decide(self, state: State) -> Decision:
        """What the planner decides in a state; it decides now, or did so as a way on."""
        if self._way_on is None or not _same(self._way_on[0], state.vehicle):
            decision = self._planner.decide(self._field, state, self._seed)
            self._way_on = state.vehicle, decision
        return self._way_on[1]

    def _meant(self, proposal: _Proposal) -> tuple[Array, Array]:
        """The agent's segment (1, 4, 2), and with it the next if that was asked (2, 4, 2)."""
        assert proposal.step is not None
        step, ahead = proposal.step, self._ahead
        flown = step.control[None]
        if ahead is None or ahead.step is None or not ahead.flies:
            return flown, flown
        if not _same(ahead.vehicle, step.state):
            return flown, flown
        return flown, np.stack([step.control, ahead.step.control])


def _same(one: transition.State, other: transition.State) -> bool:
    """Whether two states are equal to the bit."""
    return (
        one.segments == other.segments
        and np.array_equal(one.position, other.position)
        and np.array_equal(one.derivative, other.derivative)
    )
