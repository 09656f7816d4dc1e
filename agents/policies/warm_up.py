"""What no clock should count is done before: compiling, loading, starting other processes."""

from __future__ import annotations

from functools import cache

from agents.policies.registry import SHIELDED, make_planner
from agents.runtime.kernels import small_field
from planners.interface import Planner, initial_state
from planners.registry import PLANNERS
from planners.whole_path.planner import with_seconds

_SECONDS = 0.2
"""That a planner with a budget searches before its clock counts."""


def warm_policy(name: str) -> None:
    """Warm the planners that a policy's name asks for."""
    plain = name.removesuffix(SHIELDED)
    if plain != name:
        warm("guided")  # which takes over
    if plain.partition("+")[0] in PLANNERS:
        warm(plain)


@cache
def warm(name: str, seconds: float | None = None) -> Planner:
    """A planner that has planned something small, one for all of a process.

    What it loads, compiles or starts at first, a process of its own perhaps, is not timed.

    Args:
        name: of the planner.
        seconds: budget of a planner that has one; None: its own.

    Raises:
        ValueError: an unknown planner, or its library is not installed.
    """
    planner = with_seconds(make_planner(name), seconds)
    field = small_field()
    with_seconds(planner, _SECONDS).plan(field, initial_state(field), 0)
    return planner
