"""Policies choose the actions of a flight: planners, learned agents, and agents under a shield.

`make_policy` makes one from its name, whose grammar `PolicySpec` parses, and `planner_policy` one
from a planner. Every policy implements `Policy`. `Shield` lets a planner replace the segments of an
agent that fail its checks. Further modules hold agents that fly by their network alone or simulate
rollouts first, and policies that provide initial guesses for a planner.
"""

from agents.policies.interface import Policy as Policy
from agents.policies.planner_policies import planner_policy as planner_policy
from agents.policies.registry import make_policy as make_policy
from agents.policies.shield import Shield as Shield
from agents.policies.spec import PolicySpec as PolicySpec
