"""Policies by name: what flies in the environment, and any planner as one."""

from __future__ import annotations

from typing import Protocol

from agents import shelf
from agents.proposals import Proposals
from agents.shield import Shield
from ferguson_gym import flight
from ferguson_gym.actions import Action, encode
from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.observations import Observation
from ferguson_gym.spelling import meant
from planners.catalog import PLANNERS, make, starting_from
from planners.interface import Decision, Plan, Planner, Replanner, State
from planners.rollout import successor
from planners.routes import Route


class Policy(Protocol):
    """Chooses actions in one flight at a time."""

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""

    def act(self, observation: Observation, vehicle: flight.State) -> Action | None:
        """The next action, or None if the policy gives up."""


class Expert(Policy, Protocol):
    """A planner as a policy; it keeps what it decided for whoever looks on."""

    decisions: list[Decision]
    """Decisions of this flight so far."""
    route: Route | None
    """Where its plan came from, if it plans the whole path at once and has planned."""


class Replanning:
    """A planner that decides anew at each step, from the state that was flown."""

    route: Route | None = None

    def __init__(self, planner: Replanner) -> None:
        self._planner = planner
        self.decisions: list[Decision] = []

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._field, self._seed = field, seed
        self._last: tuple[State, Array] | None = None
        self.decisions = []

    def act(self, observation: Observation, vehicle: flight.State) -> Action | None:
        """The action that flies the first segment of the planner's decision."""
        state = State(vehicle) if self._last is None else successor(*self._last, vehicle)
        decision = self._planner.decide(self._field, state, self._seed)
        self.decisions.append(decision)
        if decision.chain is None:
            return None
        self._last = state, decision.chain
        return encode(decision.chain[0], vehicle.position, vehicle.derivative)


class Tracking:
    """A planner that plans once, and whose plan is then followed segment by segment."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self.decisions: list[Decision] = []
        self.route: Route | None = None

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field."""
        self._field, self._seed = field, seed
        self._plan: Plan | None = None
        self.decisions, self.route = [], None

    def act(self, observation: Observation, vehicle: flight.State) -> Action | None:
        """The action that flies the plan's next segment; plans at the first call."""
        if self._plan is None:
            self._first = vehicle.segments
            self._plan = self._planner.plan(self._field, State(vehicle), self._seed)
            self.decisions, self.route = list(self._plan.decisions), self._plan.route
        step = vehicle.segments - self._first
        if step >= len(self._plan.control):
            return None
        return encode(self._plan.control[step], vehicle.position, vehicle.derivative)


def expert(planner: Planner) -> Expert:
    """A planner as a policy: replanning where it decides step by step, else tracking."""
    return Replanning(planner) if isinstance(planner, Replanner) else Tracking(planner)


def is_planner(name: str) -> bool:
    """Whether a policy's name is that of a planner, with options or without."""
    return name.partition("+")[0] in PLANNERS


SHIELDED = "+shield"
"""Ends the name of a policy that flies under a shield."""
FROM = "+from="
"""In a planner's name, precedes the policy whose proposals it starts from."""


TRIES = "+tries="
"""In an agent's name, precedes the number of flights that it imagines before it flies."""


def make_planner(name: str) -> Planner:
    """The planner of this name, which may end on `+from=POLICY` and then starts from proposals.

    Raises:
        ValueError: there is none, or not with the options that the name carries.
    """
    plain, found, proposer = name.partition(FROM)
    planner = make(plain)
    if not found:
        return planner
    return starting_from(planner, Proposals(make_policy(proposer)), plain)


def shielded(name: str) -> Shield:
    """The policy of a name without its ending `+shield`, under a shield.

    Raises:
        ValueError: there is none, or a shield makes no sense around it.
    """
    agent = make_policy(name)
    if isinstance(agent, Tracking):
        raise ValueError(
            f"policy {name!r} plans its whole path at once and cannot hand over steps of it; "
            "shield an agent, or a planner that decides step by step"
        )
    if isinstance(agent, Shield):
        raise ValueError(f"policy {name!r} has a shield already")
    return Shield(agent)


def imagines(name: str) -> bool:
    """Whether a policy's name is that of an agent that imagines flights."""
    return not is_planner(name) and TRIES in shelf.meant(name)


def plain_agent(name: str) -> str:
    """The name of the agent in that of a policy, which is no planner's, without its options."""
    return shelf.meant(name.removesuffix(SHIELDED)).partition(TRIES)[0]


def make_policy(name: str) -> Policy:
    """The policy of this name: a planner, a shipped agent, or the path of a trained one.

    Raises:
        ValueError: there is none, or not with the options that the name carries; an agent that
            cannot be loaded.
    """
    if name.endswith(SHIELDED):
        return shielded(name.removesuffix(SHIELDED))
    if is_planner(name):
        return expert(make_planner(name))
    return _agent(shelf.meant(name))


def _agent(name: str) -> Policy:
    """The agent of a name, that may end on `+tries=N` and then imagines N flights."""
    plain, found, tries = name.partition(TRIES)
    place = shelf.find(plain)
    if place is None:
        agents = shelf.shipped()
        near = meant(name.partition("+")[0], [*PLANNERS, *agents])
        raise ValueError(
            f"unknown policy {name!r}{near}; policies are {', '.join([*PLANNERS, *agents])}, and "
            "the directories of trained agents"
        )
    if found and not (tries.isascii() and tries.isdecimal()):
        raise ValueError(f"policy {name!r}: need a whole number after {TRIES}, got {tries!r}")
    from agents.imagining import Imagining
    from agents.pilots import pilot

    return Imagining(pilot(place), int(tries)) if found else pilot(place)
