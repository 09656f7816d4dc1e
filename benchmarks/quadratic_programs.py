"""Solvers of small dense quadratic programs on those that our solver poses.

Run it from a checkout: `.venv/bin/python benchmarks/quadratic_programs.py [WINDOWS]`, after
`pip install quadprog piqp proxsuite`; those that are missing are left out. Programs are those of
the first step from every guess in windows of flights through standard/train:100 and on. Only
programs whose rows are compatible are timed, since most solvers have no rows that may be broken at
a price.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
from rich.console import Console
from rich.table import Table

from agents.benchmarks.solvers import take_windows
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field_names import get_fields
from planners.optimization.active_set import minimise
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.elastic_qp import empty_program, reach, solve
from planners.optimization.sqp.expansion import empty_expansion, expand
from planners.optimization.sqp.iterate import layout_of
from planners.optimization.sqp.lagrangian import lagrangian
from planners.optimization.sqp.modified_ldl import make_definite
from planners.optimization.window import Window
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


def by_ours(hessian: Array, gradient: Array, slopes: Array, upper: Array, lower: Array) -> Array:
    """Our compiled variant of Goldfarb & Idnani's method, rows hard; it poses rows one-sided."""
    m, x = len(gradient), np.empty(len(gradient))
    rows = np.vstack([np.eye(m), -np.eye(m), slopes])
    least = np.concatenate([lower[:m], -upper[:m], lower[m:]])
    minimise(hessian, gradient, rows, np.zeros(len(rows), np.int64), least, x, 1000)
    return x


SOLVERS: dict[str, Callable[..., Array]] = {
    "DAQP": by_daqp,
    "ours": by_ours,
    "quadprog": by_quadprog,
    "PIQP": by_piqp,
    "ProxQP": by_proxqp,
}


def first_program(window: Window, guess: Array, radius: float = 2.0) -> Program:
    """The program of the first step from a guess."""
    layout, x = layout_of(window, window.obstacles), window.chain.unknowns(guess)
    x = np.clip(x, *window.box)
    n, m, room = len(guess), len(x), 512
    here, out = empty_expansion(n, m, room), empty_program(n, m, room)
    contacts, _, length, _ = expand(x, layout, reach(radius), here)
    _, slope, curvature = window.objective.expand(length, here.control[-1, 1])
    gradient, hessian, model = np.empty(m), np.empty((m, m)), np.empty((m, m))
    pulls, none = np.zeros(n), np.zeros(contacts)
    given = layout, here, contacts, slope, curvature, pulls, none
    lagrangian(*given, BENDING, gradient, hessian)
    make_definite(hessian, 3e-2, model)
    scale = np.broadcast_to([[1.0], [3.0]], window.chain.free.shape)[window.chain.free]
    args = here, contacts, x, *window.box, scale, radius, layout, gradient, model, pulls, none
    solve(*args, out, np.empty(m))
    count = out.number[0]
    slopes = np.zeros((count, m))
    for row, begin, entries in zip(slopes, out.offsets, out.entries, strict=False):
        row[begin : begin + len(entries)] = entries
    lower, upper = np.append(out.low, out.least[:count]), np.append(out.high, np.full(count, 1e30))
    return model, gradient, slopes, upper, lower


def take_programs(windows: int) -> list[Program]:
    """The first programs of some windows, if their rows are compatible."""
    tasks = take_windows(RecedingHorizon(), get_fields("standard/train:100-199"), windows)
    posed = [first_program(task.window, guess) for task in tasks for guess in task.guesses]
    return [p for p in posed if daqp.solve(*p, np.zeros(len(p[4]), np.int32))[2] == 1]


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
