"""What no clock should count is done before: compiling, loading, starting other processes."""

from __future__ import annotations

from functools import cache

import numpy as np

from agents.policies import SHIELDED, make_planner
from ferguson_gym.environment import ObstacleField
from ferguson_gym.fields import Field
from ferguson_gym.obstacles import Discs
from planners.catalog import PLANNERS
from planners.interface import Planner, depart
from planners.shortest import exact_length
from planners.whole_path import with_seconds

_SECONDS = 0.2
"""That a planner with a budget searches before its clock counts."""


@cache
def small_field() -> Field:
    """Two discs, and a goal beyond the first window, so that one of each kind is planned."""
    discs = Discs(np.array([[9.0, 9.0], [30.0, 24.0]]), np.array([1.0, 4.0]))
    return Field(name="two discs", obstacles=discs, goal=np.array([40.0, 40.0]))


@cache
def compile_kernels() -> None:
    """Compile, or load from the cache, what every flight needs whoever flies it; once."""
    field = small_field()
    env = ObstacleField(fields=1)
    env.reset(seed=0, options={"field": field})
    env.step(np.zeros(4, np.float32))
    exact_length(field)
    field.obstacles.closest([[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [9.0, 0.0]])


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
    with_seconds(planner, _SECONDS).plan(field, depart(field), 0)
    return planner
