"""Planners by name, with budgets that a matrix of tests can afford."""

from dataclasses import replace

import pytest

from planners.interface import Evaluations, Iterations, Planner
from planners.registry import PLANNERS, make

BUDGETS = {
    "rrt-star": Iterations(1500),
    "prm": Iterations(1500),
    "bit-star": Iterations(8),
    "pso": Evaluations(40_000),
    "abc": Evaluations(40_000),
}


def quick(name: str) -> Planner:
    """The planner of this name; skips the test where its library is not installed."""
    if missing := _needs(name):
        pytest.skip(missing)
    planner = make(name)
    if name not in BUDGETS:
        return planner
    router = replace(planner.router, budget=BUDGETS[name])  # type: ignore[attr-defined]
    return replace(planner, router=router)  # type: ignore[type-var]


def installed() -> list[str]:
    """Names of the planners whose libraries are installed."""
    return [name for name in PLANNERS if _needs(name) is None]


def _needs(name: str) -> str | None:
    """What the error says if the planner's library is not installed."""
    try:
        make(name)
    except ValueError as error:
        return str(error)
    return None
