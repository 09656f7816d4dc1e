"""Warm-up before a measurement: compiling, loading and starting processes are not timed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from agents.policies.registry import make_planner
from agents.policies.spec import PolicySpec
from agents.runtime.kernels import small_field
from ferguson_gym.world import Field
from planners.interface import Planner, Replanner, State, initial_state
from planners.optimization.route_knots import turn_aligned
from planners.whole_path.planner import with_seconds

_SECONDS = 0.2
"""Search time [s] of a planner with a budget during its warm-up."""


def warm_policy(name: str) -> None:
    """Warm up the planners that a policy uses."""
    spec = PolicySpec.parse(name)
    if spec.shield:
        warm("guided")  # the shield's planner
    if spec.is_planner:
        warm(str(replace(spec, shield=False)))


@cache
def warm(name: str, seconds: float | None = None) -> Planner:
    """A planner that has planned a small field already; each process makes it once.

    What the planner loads, compiles or starts on its first plan is then done.

    Args:
        name: of the planner, with its options.
        seconds: budget of a planner that has one [s]; None: its own.

    Raises:
        ValueError: the planner is unknown, or its library is not installed.
    """
    spec = PolicySpec.parse_planner(name)
    planner = with_seconds(make_planner(spec), seconds)
    field = small_field()
    if spec.planner is not None and spec.planner.sensing is not None:
        # a range is at least the longest segment
        field = field.with_limits(longest=min(field.limits.longest, spec.planner.sensing))
    with_seconds(planner, _SECONDS).plan(field, initial_state(field), 0)
    if isinstance(planner, Replanner):
        planner.decide(field, _turned_away(field), 0)
    # routes that turn often need it
    straight = np.linspace(field.start, field.goal)
    start = initial_state(field).vehicle
    list(turn_aligned(start, straight, field.obstacles, field.limits, 3))
    return planner


def _turned_away(field: Field) -> State:
    """At the start, but away from the goal: `guided` must search there, for turns as well."""
    start = initial_state(field)
    away = replace(start.vehicle, derivative=-start.vehicle.derivative)
    return replace(start, vehicle=away)
