"""What each choice inside our solver is worth, measured in one run on the same windows.

Run it from a checkout: `.venv/bin/python benchmarks/solver_choices.py [WINDOWS]`. Windows are
taken from flights through standard/train:100 and on; every variant solves each of them from the
same starts, in turn, so that noise falls on all alike.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass, field, replace

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from agents.benchmarks.solvers import Task, take_windows
from ferguson_gym.world.field_names import get_fields
from planners.optimization.certification import Certified
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.sqp.multi_start import MultiStart
from planners.receding_horizon.paper import RecedingHorizon


@dataclass(frozen=True, slots=True)
class Variant:
    """A solver, and a weight of windows."""

    solver: MultiStart = field(default_factory=MultiStart)
    bending_weight: float = 0.0


VARIANTS = {
    "as shipped": Variant(),
    "no guess abandoned": Variant(MultiStart(search=ElasticSqp(patience=math.inf))),
    "no sidesteps": Variant(MultiStart(sidesteps=())),
    "precision 1e-3": Variant(MultiStart(search=ElasticSqp(precision=1e-3))),
    "bending 1e-5": Variant(bending_weight=1e-5),
    "bending 1e-3": Variant(bending_weight=1e-3),
    "two threads": Variant(MultiStart(threads=2)),
}


def solve(variant: Variant, task: Task) -> tuple[list[Certified], float]:
    """One step of a variant, and its time."""
    window = replace(task.window, bending_weight=variant.bending_weight)
    began = time.perf_counter()
    ends = variant.solver.solve(window, task.guesses)
    return ends, time.perf_counter() - began


def best(ends: list[Certified], task: Task) -> float:
    """Least pure objective of a certified chain."""
    program = task.window.sampled()
    chains = [end.solution.x for end in ends if end.feasible]
    return min((float(program.f(x)) for x in chains), default=math.inf)


def main(number: int) -> None:
    """Measure every variant and print a row for each."""
    tasks = take_windows(RecedingHorizon(), get_fields("standard/train:100-199"), number)
    for variant in VARIANTS.values():
        solve(variant, tasks[0])
    seconds: dict[str, list[float]] = {name: [] for name in VARIANTS}
    evaluations: dict[str, list[float]] = {name: [] for name in VARIANTS}
    objectives: dict[str, list[float]] = {name: [] for name in VARIANTS}
    feasible = dict.fromkeys(VARIANTS, 0)
    for task in track(tasks, description="windows"):
        for name, variant in VARIANTS.items():
            ends, took = solve(variant, task)
            seconds[name].append(took)
            evaluations[name].append(sum(end.evaluations for end in ends) / len(ends))
            objectives[name].append(best(ends, task))
            feasible[name] += sum(end.feasible for end in ends)
    starts = sum(len(task.guesses) for task in tasks)
    shipped = np.array(objectives["as shipped"])
    scale = np.maximum(shipped, 1.0)
    table = Table(title=f"{number} windows, {starts} starts")
    for column in ("variant", "evaluations", "time", "feasible", "worse", "better"):
        table.add_column(column, justify="left" if column == "variant" else "right")
    for name in VARIANTS:
        ratio = np.array(seconds[name]) / np.array(seconds["as shipped"])
        change = (np.array(objectives[name]) - shipped) / scale
        table.add_row(
            name,
            f"{np.median(evaluations[name]):.1f}",
            f"x {np.median(ratio):.2f}",
            f"{100 * feasible[name] / starts:.1f} %",
            f"{100 * np.mean(change > 1e-3):.1f} %",
            f"{100 * np.mean(change < -1e-3):.1f} %",
        )
    table.caption = (
        "evaluations per start and time per step: medians, time against shipped in the same "
        "window; worse, better: windows whose objective differs by more than 0.001"
    )
    Console(width=100).print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
