"""`ferguson bench solvers`: compares solvers on the same windows from the same initial guesses.

The windows are those of flights of multi-start. Each solver first solves a window from its first
guess without timing, so that preparations for a problem size are not timed.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from agents.plots.figure import figure_file
from agents.runtime import terminal_tables
from agents.runtime.csv_files import write_csv
from agents.runtime.terminal import Terminal
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field
from planners.interface import initial_state
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.ipopt import Ipopt
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import Window
from planners.receding_horizon.paper import RecedingHorizon

NO_WORSE = 1e-3
"""Relative tolerance of objectives that count as equal; relative to the gate if that is larger."""
_COLOURS = {"ours": drawing.SEGMENTS[0], "slsqp": drawing.SEGMENTS[1], "ipopt": drawing.HORIZON}


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A window and its initial guesses."""

    name: str
    window: Window
    guesses: Sequence[Array]


@dataclass(frozen=True, slots=True)
class Solved:
    """The results of one solver in one window."""

    solver: str
    window: str
    starts: int
    feasible: int
    """Number of starts that led to a certified chain."""
    objective: float
    """Least objective of a certified chain [m]; infinite without one."""
    seconds: float
    """Time of all starts together, certification included [s]."""
    solve_seconds: list[float]
    """Time from each start [s]."""


def solvers() -> dict[str, WindowSolver]:
    """The solvers by name."""
    return {"ours": MultiStart(), "slsqp": ByExchange(Slsqp()), "ipopt": ByExchange(Ipopt())}


def take_windows(planner: RecedingHorizon, fields: Iterable[Field], number: int) -> list[Task]:
    """The first windows of a planner's flights through fields.

    Raises:
        ValueError: the fields have fewer windows.
    """
    tasks: list[Task] = []
    for field in fields:
        plan = planner.plan(field, initial_state(field), 0)
        for state, decision in zip(plan.states, plan.decisions, strict=False):
            if decision.report.starts == 0:
                continue
            window = planner.window(field, state.vehicle)
            starts = next(planner.starts(window, state, 0))
            name = f"{field.name} step {state.vehicle.segments}"
            tasks.append(Task(name, window, [guess for _, guess in starts]))
            if len(tasks) == number:
                return tasks
    raise ValueError(f"these fields have {len(tasks)} windows, {number} are asked for")


def measure(name: str, solver: WindowSolver, task: Task) -> Solved:
    """Solve one window from all its guesses."""
    solver.solve(task.window, task.guesses[:1])
    began = time.perf_counter()
    ends: list[Certified] = solver.solve(task.window, task.guesses)
    seconds = time.perf_counter() - began
    objectives = [end.solution.objective for end in ends if end.feasible]
    return Solved(
        solver=name,
        window=task.name,
        starts=len(task.guesses),
        feasible=len(objectives),
        objective=min(objectives, default=np.inf),
        seconds=seconds,
        solve_seconds=[end.seconds for end in ends],
    )


def excess(results: Sequence[Solved], gate: float) -> dict[str, Array]:
    """Relative excess of each solver's objectives over the best one, by solver: (windows,).

    It is infinite where the solver found no certified chain and another did.
    """
    best: dict[str, float] = {}
    for result in results:
        best[result.window] = min(best.get(result.window, np.inf), result.objective)
    found: dict[str, list[float]] = {}
    for result in results:
        least = best[result.window]
        above = 0.0 if np.isinf(least) else (result.objective - least) / max(least, gate)
        found.setdefault(result.solver, []).append(above)
    return {name: np.array(values) for name, values in found.items()}


def bench(tasks: Sequence[Task], ipopt_every: int, out: Path, terminal: Terminal) -> None:
    """Run the comparison, print the table, and write steps.csv and solvers.png."""
    results: list[Solved] = []
    with terminal.still_bar() as progress:
        bar = progress.add_task("windows", total=len(tasks))
        for index, task in enumerate(tasks):
            for name, solver in solvers().items():
                if name == "ipopt" and (ipopt_every == 0 or index % ipopt_every):
                    continue
                results.append(measure(name, solver, task))
            progress.advance(bar)
            progress.refresh()
    out.mkdir(parents=True, exist_ok=True)
    columns = ("solver", "window", "starts", "feasible", "objective", "seconds")
    cells = ([getattr(result, name) for name in columns] for result in results)
    write_csv(out / "steps.csv", columns, cells)
    gate = tasks[0].window.field.limits.gate
    draw(results, gate, out / "solvers.png")
    terminal.show(table(results, gate))
    for name in dict.fromkeys(result.solver for result in results):
        if name != "ours":
            terminal.show(against(name, results, gate))
    terminal.note(f"wrote steps.csv, solvers.png to {out}")


def against(name: str, results: Sequence[Solved], gate: float) -> str:
    """A sentence that compares our solver with another, window by window."""
    theirs = {r.window: r for r in results if r.solver == name}
    pairs = [(r, theirs[r.window]) for r in results if r.solver == "ours" and r.window in theirs]
    no_worse = sum(a.objective <= b.objective + NO_WORSE * max(b.objective, gate) for a, b in pairs)
    better = sum(b.objective > a.objective + NO_WORSE * max(a.objective, gate) for a, b in pairs)
    return (
        f"ours against {name}: objective no worse in {no_worse} of {len(pairs)} windows, "
        f"better in {better}; certified chains {sum(a.feasible for a, _ in pairs)} against "
        f"{sum(b.feasible for _, b in pairs)}"
    )


def table(results: Sequence[Solved], gate: float) -> Table:
    """The table, a row for each solver."""
    rows = terminal_tables.empty_table(
        "Solvers on the same windows from the same starts",
        "solver",
        "windows",
        "solved",
        "starts",
        "solve [ms]",
        "step [ms]",
        "x ours",
        "no worse",
        caption=(
            "solved: windows with a certified chain; starts: those that led to one; times: medians "
            "(95 %, for steps 99 % too); x ours: median of the steps' ratios; no worse: objective "
            f"within {NO_WORSE:g} of the best of all"
        ),
    )
    above = excess(results, gate)
    ours = {r.window: r.seconds for r in results if r.solver == "ours"}
    for name, excesses in above.items():
        mine = [r for r in results if r.solver == name]
        step = 1e3 * np.array([r.seconds for r in mine])
        solve = 1e3 * np.concatenate([r.solve_seconds for r in mine])
        ratio = np.median([r.seconds / ours[r.window] for r in mine])
        rows.add_row(
            name,
            str(len(mine)),
            str(sum(r.feasible > 0 for r in mine)),
            f"{100 * sum(r.feasible for r in mine) / sum(r.starts for r in mine):.1f} %",
            _percentiles(solve, [50, 95]),
            _percentiles(step, [50, 95, 99]),
            f"{ratio:.0f}",
            f"{100 * np.mean(excesses <= NO_WORSE):.1f} %",
        )
    return rows


def _percentiles(values: Array, shares: Sequence[float]) -> str:
    first, *others = (
        f"{v:.1f}" if v < 100.0 else f"{v:.0f}" for v in np.percentile(values, shares)
    )
    return f"{first} ({', '.join(others)})"


def draw(results: Sequence[Solved], gate: float, path: Path) -> None:
    """Draw the distributions of times and of objectives above the best."""
    above = excess(results, gate)
    with figure_file(path, 7.2, 3.0) as figure:
        left, right = figure.subplots(1, 2)
        for name, excesses in above.items():
            seconds = 1e3 * np.sort([r.seconds for r in results if r.solver == name])
            share = 100.0 * np.arange(1, len(seconds) + 1) / len(seconds)
            label = f"{name} ({len(seconds)} windows)"
            left.step(seconds, share, where="post", color=_COLOURS[name])
            part = np.sort(np.clip(excesses, 1e-6, None))
            right.step(part, share, where="post", color=_COLOURS[name], label=label)
        left.set(xscale="log", xlabel="multi-start step [ms]", ylabel="windows [%]", ylim=(0, 101))
        label = "objective above the best of all, relative"
        right.set(xscale="log", xlabel=label, xlim=(1e-6, 3.0), ylim=(0, 101))
        right.axvline(NO_WORSE, color=drawing.OBSTACLE_EDGE, lw=0.8, ls=":")
        right.legend(loc="lower right", frameon=False, fontsize=7)
