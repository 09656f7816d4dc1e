"""Policies choose the actions of a flight: planners, learned agents, and both under a shield.

`make_policy` makes one from its name, whose grammar `PolicySpec` parses; `Policy` is the interface
that anything that flies implements; `Shield` lets a planner replace an agent's doubtful segments.
Further modules hold planners as policies, agents that fly by their network alone or simulate
flights first, and policies that propose where a planner's windows start.
"""

from agents.policies.interface import Policy as Policy
from agents.policies.registry import make_policy as make_policy
from agents.policies.shield import Shield as Shield
from agents.policies.spec import PolicySpec as PolicySpec
