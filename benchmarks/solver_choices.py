"""What each choice inside our solver is worth, measured in one run on the same windows.

Run it from a checkout: `.venv/bin/python benchmarks/solver_choices.py [WINDOWS]`. Windows are
taken from flights through standard/train:100 and on; every variant solves each of them from the
same starts, in turn, so that noise falls on all alike.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from agents.benchmarks.solvers import Task, take_windows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field_names import get_fields
from planners.optimization.certification import Certified
from planners.optimization.sqp import elastic_sqp
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.sqp.iterate import Iterate
from planners.optimization.sqp.multi_start import MultiStart
from planners.receding_horizon.paper import RecedingHorizon


def raise_eigenvalues(matrix: Array, floor: float, out: Array) -> None:
    """In the place of `make_definite`: by eigenvalue decomposition."""
    values, vectors = np.linalg.eigh(matrix)
    values = np.maximum(np.maximum(values, 0.3 * np.abs(values)), floor)
    out[:] = (vectors * values) @ vectors.T


def _lagrangian_gradient(point: Iterate, tension: Array, pulls: Array) -> Array:
    return point.gradient - tension @ point.expansion.length_slope - pulls


class _Bfgs(elastic_sqp.Search):
    """Damped BFGS (Powell 1978) in the place of the exact Hessian."""

    def _differentiate(self, point: Iterate, before: Iterate, multipliers: Array) -> None:
        old = before.hessian.copy()
        super()._differentiate(point, before, multipliers)
        if point is before:
            point.hessian[:] = np.diag(1.0 / self.scale**2)
            return
        n = len(point.tension)
        rows = self.rows.taken[: len(multipliers) - n]
        past = multipliers[n:] @ before.expansion.slope[rows]
        now = point.multiplier[: point.contacts] @ point.expansion.slope[: point.contacts]
        s = point.x - before.x
        y = _lagrangian_gradient(point, point.tension, now)
        y = y - _lagrangian_gradient(before, point.tension, past)
        bent = old @ s
        stiffness, curvature = float(s @ bent), float(s @ y)
        if curvature < 0.2 * stiffness:
            share = 0.8 * stiffness / (stiffness - curvature)
            y = share * y + (1.0 - share) * bent
        old += np.outer(y, y) / float(s @ y) - np.outer(bent, bent) / stiffness
        point.hessian[:] = old


class _L1Merit:
    """In the place of the filter: objective plus 40 times the violation must fall."""

    def __init__(self, most: float) -> None:
        self._last = math.inf

    def add(self, objective: float, violation: float) -> None:
        """Remember a point."""
        self._last = objective + 40.0 * violation

    def accepts(self, objective: float, violation: float) -> bool:
        """Whether the merit falls."""
        return objective + 40.0 * violation < self._last


@contextmanager
def as_shipped() -> Iterator[None]:
    """Change nothing."""
    yield


@dataclass(frozen=True, slots=True)
class Variant:
    """A solver, and what is patched while it works."""

    solver: MultiStart = field(default_factory=MultiStart)
    patched: Callable[[], object] = as_shipped
    bending_weight: float = 0.0


VARIANTS = {
    "as shipped": Variant(),
    "eigenvalue decomposition": Variant(
        patched=lambda: patch(
            "planners.optimization.sqp.elastic_sqp.make_definite", raise_eigenvalues
        )
    ),
    "damped BFGS": Variant(
        patched=lambda: patch("planners.optimization.sqp.multi_start.Search", _Bfgs)
    ),
    "l1 merit instead of filter": Variant(
        patched=lambda: patch("planners.optimization.sqp.elastic_sqp.Filter", _L1Merit)
    ),
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
    with variant.patched():  # type: ignore[attr-defined]
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
