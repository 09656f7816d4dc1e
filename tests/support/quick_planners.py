"""Planners by name, with budgets that a matrix of tests can afford."""

from dataclasses import replace

import pytest

from planners.interface import Evaluations, Iterations, Planner
from planners.registry import make

BUDGETS = {
    "rrt-star": Iterations(1500),
    "prm": Iterations(1500),
    "bit-star": Iterations(8),
    "pso": Evaluations(40_000),
    "abc": Evaluations(40_000),
}


def quick(name: str) -> Planner:
    """The planner of this name; skips the test where its library is not installed."""
    try:
        planner = make(name)
    except ValueError as error:
        pytest.skip(str(error))
    if name not in BUDGETS:
        return planner
    router = replace(planner.router, budget=BUDGETS[name])  # type: ignore[attr-defined]
    return replace(planner, router=router)  # type: ignore[type-var]
