"""Warm-up before a measurement: compiling, loading and starting processes are not timed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from agents.policies.registry import make_planner
from agents.policies.spec import PolicySpec
from agents.runtime.kernels import small_field
from planners.interface import Planner, initial_state
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
    return planner
