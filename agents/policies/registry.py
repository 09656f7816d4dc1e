"""Makes policies from their names."""

from __future__ import annotations

from dataclasses import replace

from agents.models import shipped_agents
from agents.policies.interface import Policy
from agents.policies.limited_sensing import SensingPolicy
from agents.policies.planner_policies import TrackingPolicy, planner_policy
from agents.policies.policy_proposals import PolicyProposer
from agents.policies.shield import Shield
from agents.policies.spec import PolicySpec
from ferguson_gym.runtime import did_you_mean
from planners import Planner
from planners.registry import PLANNERS, starting_from


def make_planner(spec: PolicySpec) -> Planner:
    """The planner of a planner's name; it starts from another policy's flights if so named.

    Raises:
        ValueError: an option does not fit the planner, or a library is not installed.
    """
    assert spec.planner is not None
    planner = spec.planner.make()
    if spec.start_from is None:
        return planner
    if spec.start_from.sensing is not None:
        raise ValueError(
            f"planner {str(spec)!r}: the flights that it starts from are imagined, and nothing is "
            "sensed in them; leave +sensing out behind +from="
        )
    return starting_from(planner, PolicyProposer(_make(spec.start_from)), str(spec.planner))


def make_policy(name: str) -> Policy:
    """The policy of this name: a planner, a shipped agent, or a trained one by its path.

    Raises:
        ValueError: the policy is unknown, its options do not fit, or the agent cannot be loaded.
    """
    return _make(PolicySpec.parse(name))


def _make(spec: PolicySpec) -> Policy:
    if not spec.shield:
        return planner_policy(make_planner(spec)) if spec.is_planner else _agent(spec)
    plain = replace(spec, shield=False)
    policy = _make(plain)
    if isinstance(policy, TrackingPolicy):
        raise ValueError(
            f"policy {str(plain)!r} plans its whole path at once and cannot hand over steps of it; "
            "shield an agent, or a planner that decides step by step"
        )
    return Shield(policy)


def _agent(spec: PolicySpec) -> Policy:
    directory = shipped_agents.find_agent(spec.agent)
    if directory is None:
        known = [*PLANNERS, *shipped_agents.shipped()]
        near = did_you_mean(spec.agent.split("+")[0], known)
        raise ValueError(
            f"unknown policy {str(spec)!r}{near}; policies are {', '.join(known)}, and the "
            "directories of trained agents"
        )
    from agents.policies.lookahead import LookaheadPolicy
    from agents.policies.network_policy import network_policy

    agent = network_policy(directory)
    policy = agent if spec.tries is None else LookaheadPolicy(agent, spec.tries)
    return policy if spec.sensing is None else SensingPolicy(policy, spec.sensing)
