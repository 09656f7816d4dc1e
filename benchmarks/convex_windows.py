"""Decisions of the planner `convex` beside their bound: programs, rows, iterations and time.

Run it from a checkout, with suites and how many fields of each; 6,000 fields of standard have more
than 100,000 decisions:

    .venv/bin/python benchmarks/convex_windows.py standard/train:0-5999
    .venv/bin/python benchmarks/convex_windows.py dense/validation:0-999 traps/validation:0-999
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import Field, Outcome, get_fields, transition
from planners.interface import State
from planners.optimization.convex import Effort
from planners.receding_horizon.convex import PLANNED, Convex
from planners.rollout import ends_on_goal, successor

PLANNER = Convex()
COLUMNS = ("fields", "arrived", "decisions", "plan flown", "programs", "rows", "iterations")
HEADER = f"| {' | '.join(COLUMNS)} | median [ms] | 99 % | most |\n|{' --- |' * 10}"


class Flight(NamedTuple):
    """What the decisions of a flight took."""

    efforts: list[Effort]
    seconds: list[float]
    planned: int
    """How often the rest of a plan was flown that does not end on the goal."""
    arrived: bool


def flight(field: Field) -> Flight:
    """Fly through a field."""
    distance_to_go(field)  # made once a field, before the first decision
    state, outcome = State(transition.initial_state(field)), Outcome.FLYING
    efforts, seconds, planned = list[Effort](), list[float](), 0
    while outcome is Outcome.FLYING:
        began = time.perf_counter()
        choice = PLANNER.choose(field, state)
        seconds.append(time.perf_counter() - began)
        efforts.append(choice.effort)
        if choice.chain is None or choice.step is None:
            break
        planned += choice.start == PLANNED and not ends_on_goal(field, state)
        state, outcome = successor(state, choice.chain, choice.step.state), choice.step.outcome
    return Flight(efforts, seconds, planned, outcome is Outcome.GOAL_REACHED)


def row(spec: str) -> str:
    """A line of the table."""
    flights = [flight(field) for field in get_fields(spec)]
    efforts = [effort for one in flights for effort in one.efforts]
    most = [max(effort[k] for effort in efforts) for k in range(3)]
    seconds = np.concatenate([one.seconds for one in flights])
    median, slow, worst = 1e3 * np.quantile(seconds, [0.5, 0.99, 1.0])
    return (
        f"| {spec} | {sum(one.arrived for one in flights)}/{len(flights)} | {len(efforts):,} | "
        f"{sum(one.planned for one in flights)} | {most[0]} | {most[1]} | {most[2]} | "
        f"{median:.2f} | {slow:.2f} | {worst:.2f} |"
    )


def main(specs: Sequence[str]) -> None:
    """Print the table."""
    flight(next(iter(get_fields("standard/train:0"))))  # compiles
    caps = PLANNER.solver.caps
    print(
        f"At most {PLANNER.programs} programs a decision, each of {4 * PLANNER.segments} unknowns, "
        f"{caps.rows} rows and {caps.iterations} iterations."
    )
    print(HEADER)
    for spec in specs:
        print(row(spec), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["standard/validation:0-99"])
