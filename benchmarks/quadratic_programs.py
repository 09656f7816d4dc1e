"""Solvers of small dense quadratic programs on those that our solver poses.

Run it from a checkout: `.venv/bin/python benchmarks/quadratic_programs.py [WINDOWS]`, after
`pip install quadprog piqp proxsuite`; those that are missing are left out. Programs are taken
from windows of flights through standard/train:100 and on. Only programs whose rows are
compatible are timed, since only DAQP has rows that may be broken at a price.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import daqp
import numpy as np
from rich.console import Console
from rich.table import Table

from agents.benchmarks.solvers import take_windows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field_names import get_fields
from planners.optimization.sqp.multi_start import MultiStart
from planners.receding_horizon.paper import RecedingHorizon

Program = tuple[Array, Array, Array, Array, Array]
"""Hessian (m, m), gradient (m,), slopes (rows, m), upper and lower (m + rows,)."""


def by_daqp(hessian: Array, gradient: Array, slopes: Array, upper: Array, lower: Array) -> Array:
    """DAQP, rows hard."""
    sense = np.zeros(len(upper), np.int32)
    return np.asarray(daqp.solve(hessian, gradient, slopes, upper, lower, sense)[0])


def by_quadprog(
    hessian: Array, gradient: Array, slopes: Array, upper: Array, lower: Array
) -> Array:
    """Goldfarb & Idnani's dual active-set method."""
    quadprog: Any = importlib.import_module("quadprog")
    rows = np.vstack([np.eye(len(gradient)), slopes])
    high = upper < 1e20
    normals = np.vstack([rows, -rows[high]]).T
    return np.asarray(
        quadprog.solve_qp(hessian, -gradient, normals, np.concatenate([lower, -upper[high]]))[0]
    )


def by_piqp(hessian: Array, gradient: Array, slopes: Array, upper: Array, lower: Array) -> Array:
    """A proximal interior-point method."""
    piqp: Any = importlib.import_module("piqp")
    m, solver = len(gradient), piqp.DenseSolver()
    solver.setup(hessian, gradient, None, None, slopes, lower[m:], upper[m:], lower[:m], upper[:m])
    solver.solve()
    return np.asarray(solver.result.x)


def by_proxqp(hessian: Array, gradient: Array, slopes: Array, upper: Array, lower: Array) -> Array:
    """A proximal augmented Lagrangian method."""
    proxsuite: Any = importlib.import_module("proxsuite")
    m = len(gradient)
    solver = proxsuite.proxqp.dense.QP(m, 0, len(slopes), True)
    solver.settings.eps_abs = 1e-9
    solver.init(hessian, gradient, None, None, slopes, lower[m:], upper[m:], lower[:m], upper[:m])
    solver.solve()
    return np.asarray(solver.results.x)


SOLVERS: dict[str, Callable[..., Array]] = {
    "DAQP": by_daqp,
    "quadprog": by_quadprog,
    "PIQP": by_piqp,
    "ProxQP": by_proxqp,
}


def take_programs(windows: int) -> list[Program]:
    """Every seventh program that is posed in some windows, if its rows are compatible."""
    posed: list[Program] = []

    def listen(*program: Any, **options: Any) -> Any:
        hessian, gradient, slopes, upper, lower, sense = (part.copy() for part in program)
        if daqp.solve(hessian, gradient, slopes, upper, lower, np.zeros_like(sense))[2] == 1:
            posed.append((hessian, gradient, slopes, upper, lower))
        return daqp.solve(*program, **options)

    tasks = take_windows(RecedingHorizon(), get_fields("standard/train:100-199"), windows)
    with patch("planners.optimization.sqp.elastic_qp.daqp") as listener:
        listener.solve.side_effect = listen
        for task in tasks:
            MultiStart().solve(task.window, task.guesses)
    return posed[::7]


def main(windows: int) -> None:
    """Time every solver on every program and print a row for each solver."""
    programs = take_programs(windows)
    values = np.array([_value(p, by_daqp(*p)) for p in programs])
    rows = np.median([len(p[2]) for p in programs])
    table = Table(
        title=f"{len(programs)} programs of {len(programs[0][1])} unknowns, {rows:.0f} rows "
        "in the median"
    )
    for column in ("solver", "median [us]", "95 % [us]", "same value"):
        table.add_column(column, justify="left" if column == "solver" else "right")
    for name, solver in SOLVERS.items():
        try:
            solver(*programs[0])
        except ImportError:
            table.add_row(name, "not installed", "", "")
            continue
        took, same = [], 0
        for program, value in zip(programs, values, strict=True):
            began = time.perf_counter()
            try:
                x = solver(*program)
            except ValueError:  # quadprog, on what it takes for incompatible
                x = np.full(len(program[1]), np.nan)
            took.append(1e6 * (time.perf_counter() - began))
            same += abs(_value(program, x) - value) <= 1e-6 * max(1.0, abs(value))
        middle, high = np.percentile(took, [50, 95])
        share = f"{100 * same / len(programs):.1f} %"
        table.add_row(name, f"{middle:.0f}", f"{high:.0f}", share)
    Console(width=100).print(table)


def _value(program: Program, x: Array) -> float:
    return float(x @ (0.5 * program[0] @ x + program[1]))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
