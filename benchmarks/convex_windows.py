"""Windows of the planner `convex` beside their bound: programs, rows, iterations and time.

Run it from a checkout, with suites and how many fields of each; 5,000 fields of standard have more
than 100,000 windows:

    .venv/bin/python benchmarks/convex_windows.py standard/train:0-4999
    .venv/bin/python benchmarks/convex_windows.py dense/validation:0-999 traps/validation:0-999
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np

from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import Field, Outcome, get_fields, transition
from planners.interface import State
from planners.optimization.convex import Effort
from planners.receding_horizon import Convex
from planners.rollout import remaining_plan, successor

PLANNER = Convex()
COLUMNS = ("fields", "arrived", "windows", "tails flown", "programs", "rows", "iterations")
HEADER = f"| {' | '.join(COLUMNS)} | median [ms] | 99 % | most |\n|{' --- |' * 10}"


def flight(field: Field) -> tuple[list[Effort], list[float], int, bool]:
    """Effort and seconds of each window of a flight, how often the tail was flown, and success."""
    distance_to_go(field)  # made once a field, before the first decision
    state, outcome = State(transition.initial_state(field)), Outcome.FLYING
    efforts, seconds, tails = list[Effort](), list[float](), 0
    while outcome is Outcome.FLYING:
        began = time.perf_counter()
        found, effort = PLANNER.window(field, state.vehicle)
        seconds.append(time.perf_counter() - began)
        efforts.append(effort)
        if found is None:
            rest = remaining_plan(field, state)
            if rest is None:
                break
            tails += 1
            chain, step = rest
        else:
            chain, step = found.control, found.step
        state, outcome = successor(state, chain, step.state), step.outcome
    return efforts, seconds, tails, outcome is Outcome.GOAL_REACHED


def row(spec: str) -> str:
    """A line of the table."""
    efforts, seconds, tails, arrived, number = list[Effort](), list[float](), 0, 0, 0
    for field in get_fields(spec):
        some, times, flown, success = flight(field)
        efforts += some
        seconds += times
        tails += flown
        arrived += success
        number += 1
    most = [max(effort[k] for effort in efforts) for k in range(3)]
    median, slow, worst = 1e3 * np.quantile(seconds, [0.5, 0.99, 1.0])
    return (
        f"| {spec} | {arrived}/{number} | {len(efforts):,} | {tails} | {most[0]} | {most[1]} | "
        f"{most[2]} | {median:.2f} | {slow:.2f} | {worst:.2f} |"
    )


def main(specs: Sequence[str]) -> None:
    """Print the table."""
    flight(next(iter(get_fields("standard/train:0"))))  # compiles
    solver = PLANNER.solver
    print(
        f"At most {len(PLANNER.grains) * solver.rounds} programs a window, each of "
        f"{4 * PLANNER.segments} unknowns, {solver.rows} rows and {solver.iterations} iterations."
    )
    print(HEADER)
    for spec in specs:
        print(row(spec), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["standard/validation:0-99"])
