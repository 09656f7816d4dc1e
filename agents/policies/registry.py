"""Policies by name: what flies in the environment, and any planner as one."""

from __future__ import annotations

from agents.models import shipped_agents
from agents.policies.interface import Policy
from agents.policies.planner_policies import Tracking, expert
from agents.policies.policy_proposals import PolicyProposer
from agents.policies.shield import Shield
from ferguson_gym.runtime.suggestions import did_you_mean
from planners.interface import Planner
from planners.registry import PLANNERS, make, starting_from


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
    return starting_from(planner, PolicyProposer(make_policy(proposer)), plain)


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
    return not is_planner(name) and TRIES in shipped_agents.meant(name)


def plain_agent(name: str) -> str:
    """The name of the agent in that of a policy, which is no planner's, without its options."""
    return shipped_agents.meant(name.removesuffix(SHIELDED)).partition(TRIES)[0]


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
    return _agent(shipped_agents.meant(name))


def _agent(name: str) -> Policy:
    """The agent of a name, that may end on `+tries=N` and then imagines N flights."""
    plain, found, tries = name.partition(TRIES)
    place = shipped_agents.find(plain)
    if place is None:
        agents = shipped_agents.shipped()
        near = did_you_mean(name.partition("+")[0], [*PLANNERS, *agents])
        raise ValueError(
            f"unknown policy {name!r}{near}; policies are {', '.join([*PLANNERS, *agents])}, and "
            "the directories of trained agents"
        )
    if found and not (tries.isascii() and tries.isdecimal()):
        raise ValueError(f"policy {name!r}: need a whole number after {TRIES}, got {tries!r}")
    from agents.policies.lookahead import LookaheadPolicy
    from agents.policies.network_policy import network_policy

    return LookaheadPolicy(network_policy(place), int(tries)) if found else network_policy(place)
