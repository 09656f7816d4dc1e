"""Flying a policy through a field in the environment, and what is measured of the flight."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from agents.flights.metrics import path_share
from agents.policies.interface import Policy
from agents.policies.registry import make_policy
from agents.policies.shield_decisions import ShieldDecision
from agents.policies.warm_up import warm_policy
from agents.runtime.kernels import compile_kernels
from ferguson_gym.curves.path import Path
from ferguson_gym.environment import ObstacleField
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import exact_length, gap
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from planners.interface import Decision, Route


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Flight:
    """One flight of a policy through a field."""

    policy: str
    field: Field
    seed: int
    """Policy seed."""
    outcome: Outcome
    control: Array
    """Segments (n, 4, 2) flown, as far as it got."""
    refused: Array | None
    """The segment (4, 2) that ended the flight without being flown, if one did."""
    clearance: float
    """Least clearance along what was flown [m]."""
    seconds: float
    """The whole flight."""
    decision_seconds: list[float]
    """Time to choose each action."""
    decisions: list[Decision]
    """What a planner decided; empty for policies that are none."""
    hands: Sequence[ShieldDecision] = ()
    """In whose hands each step was; empty for policies without a shield."""
    route: Route | None = None
    """What a planner of whole paths found before segments were fitted to it."""

    @property
    def success(self) -> bool:
        """Whether the flight was feasible and ended on the goal."""
        return self.outcome.success

    @property
    def length(self) -> float:
        """Length flown [m]."""
        return Path(self.control).length if len(self.control) else 0.0

    @property
    def exact_length(self) -> float | None:
        """Length of the field's shortest path [m]; None without one, or without plane discs."""
        return exact_length(self.field)

    @property
    def gap(self) -> float | None:
        """Length / exact length - 1; None unless the flight succeeded."""
        exact = self.exact_length
        return None if exact is None or not self.success else gap(self.length, exact)

    @property
    def path_share(self) -> float:
        """Its part in SPL, the mean of these over flights."""
        return float(path_share(self.success, self.length, self.exact_length))

    @property
    def min_turn_radius(self) -> float:
        """Smallest turn radius flown [m]; infinite if it never turned."""
        return Path(self.control).min_turn_radius if len(self.control) else math.inf

    @property
    def evaluations(self) -> int:
        """Evaluations of the objective by the planner, over the flight."""
        return sum(decision.report.evaluations for decision in self.decisions)


def fly(policy: Policy, name: str, field: Field, seed: int) -> Flight:
    """Fly a policy through a field in the environment: a function of (policy, field, seed)."""
    compile_kernels()
    env = ObstacleField(fields=1)  # no room for drawn fields: one is handed in
    began = time.perf_counter()
    observation, info = env.reset(seed=0, options={"field": field})
    policy.begin(field, seed)
    outcome = Outcome.FLYING
    decision_seconds: list[float] = []
    while outcome is Outcome.FLYING:
        asked = time.perf_counter()
        action = policy.act(observation, env.state)
        decision_seconds.append(time.perf_counter() - asked)
        if action is None:
            outcome = Outcome.GAVE_UP
            break
        observation, _, _, _, info = env.step(action)
        outcome = Outcome.from_code(info["outcome"])
    return Flight(
        policy=name,
        field=field,
        seed=seed,
        outcome=outcome,
        control=env.control,
        refused=env.refused,
        clearance=float(info["clearance"]),
        seconds=time.perf_counter() - began,
        decision_seconds=decision_seconds,
        decisions=list(getattr(policy, "decisions", [])),
        hands=list(getattr(policy, "hands", [])),
        route=getattr(policy, "route", None),
    )


def fly_by_name(name: str, field: Field, seed: int) -> Flight:
    """As `fly`, for a policy by its name: what a worker process is handed.

    Raises:
        ValueError: an unknown policy, or an agent that cannot be loaded.
    """
    policy = make_policy(name)  # agents are ready when they are loaded
    warm_policy(name)
    return fly(policy, name, field, seed)
