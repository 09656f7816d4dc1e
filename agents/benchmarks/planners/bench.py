"""`ferguson bench planners`: compares planners on the same fields; tables and files."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.table import Table

from agents.benchmarks.planners import ompl_log, plots
from agents.benchmarks.planners.runs import FALSE_SUCCESS, LIBRARIES, Run, runs
from agents.flights import metrics
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.policies.knowledge import LEGEND, grouped
from agents.runtime import provenance, terminal_tables
from agents.runtime.csv_files import write_csv
from agents.runtime.terminal import Terminal
from agents.runtime.terminal_tables import add_group, decimal
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world import Field
from planners import make
from planners.interface import Status, knowledge_of

COLUMNS = (
    *("planner", "field", "seed", "status", "success"),
    *("raw_length", "length", "exact_length", "raw_gap", "gap"),
    *("clearance", "min_turn_radius", "max_turn_speed", "bending", "segments"),
    *("evaluations", "seconds_first", "seconds"),
)
"""Columns of planners.csv; cells that a failed plan has no value for are empty."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """The planners, fields and settings of a comparison."""

    planners: Sequence[str]
    left_out: Mapping[str, str]
    """Planners that are not installed, with instructions to install them."""
    fields: Sequence[Field]
    seeds: Sequence[int]
    seconds: float | None
    """Search time of planners with a budget [s]; None: their own budgets."""
    workers: int
    changes: FieldChanges = UNCHANGED
    """How the fields were changed, for the record."""


def bench(request: Request, out: Path, terminal: Terminal) -> list[Run]:
    """Run the comparison, print the table and write all files.

    After an interruption planners.csv holds the finished runs.
    """
    for name, hint in request.left_out.items():
        terminal.note(f"left out {name}: {hint}")
    began = datetime.now()
    clock = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    finished: list[Run] = []
    try:
        finished.extend(_runs(request, terminal))
    finally:  # finished rows are kept after an interruption
        write_csv(out / "planners.csv", COLUMNS, map(row, finished))
    total = time.perf_counter() - clock
    report = summary(finished, request)
    _write(out / "planners.log", ompl_log.write(finished, began, total, request.seconds))
    _write(out / "summary.json", [json.dumps(report, indent=2, allow_nan=False)])
    plots.draw(finished, out)
    terminal.show_json(json.dumps(report, allow_nan=False))
    terminal.show(table(report))
    for one in report["planners"]:
        if one["failures"]:
            causes = ", ".join(f"{number} {cause}" for cause, number in one["failures"].items())
            terminal.show(f"{one['planner']} failed: {causes}")
    terminal.note(f"wrote planners.csv, planners.log, summary.json, pictures to {out}")
    return finished


def _runs(request: Request, terminal: Terminal) -> Iterator[Run]:
    number = len(request.planners) * len(request.fields) * len(request.seeds)
    with terminal.still_bar() as progress:
        task = progress.add_task("plans", total=number)
        what = request.fields, request.seeds
        for run in runs(request.planners, request.seconds, *what, request.workers):
            yield run
            progress.advance(task)
            progress.refresh()


def _write(path: Path, lines: Iterable[str]) -> None:
    with atomic_write(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in lines)


def row(run: Run) -> list[object]:
    """A row of planners.csv."""
    cells = {name: getattr(run, name) for name in COLUMNS}
    cells["field"], cells["success"] = run.field.name, int(run.success)
    return ["" if cell is None else cell for cell in cells.values()]


def summary(finished: Sequence[Run], request: Request) -> dict[str, Any]:
    """The content of summary.json: settings, statistics, machine and versions."""
    return {
        "fields": [field.name for field in request.fields],
        "seeds": list(request.seeds),
        **request.changes.as_json(),
        "budget_seconds": request.seconds,
        "workers": request.workers,
        "left_out": dict(request.left_out),
        "planners": [
            statistics([run for run in finished if run.planner == name])
            | {"knows": knowledge_of(make(name)).label}
            for name in request.planners
        ],
        **provenance.facts(*LIBRARIES),
    }


def statistics(mine: Sequence[Run]) -> dict[str, Any]:
    """Statistics of one planner's runs; None where a number is missing or infinite."""
    successes = [run for run in mine if run.success]
    gaps = [run.gap for run in successes if run.gap is not None]
    failed = [run for run in mine if not run.success]
    causes = Counter(_cause(run) for run in failed)
    # seeds on one field are not independent trials, and do not matter to many planners
    fields = len({run.field.name for run in mine})
    low, high = metrics.success_interval(fields * len(successes) / len(mine), fields)
    firsts = [run.seconds_first for run in mine]
    return {
        "planner": mine[0].planner,
        "runs": len(mine),
        "successes": len(successes),
        "success_low": low,
        "success_high": high,
        "failures": dict(causes),
        "raw_gap_median": _quantile([r.raw_gap for r in successes if r.raw_gap is not None], 0.5),
        "gap_median": _quantile(gaps, 0.5),
        "gap_90": _quantile(gaps, 0.9),
        "gap_99": _quantile(gaps, 0.99),
        "min_turn_radius_median": _quantile(
            [run.min_turn_radius for run in successes if run.min_turn_radius is not None], 0.5
        ),
        "seconds_first_median": _quantile([math.inf if s is None else s for s in firsts], 0.5),
        "seconds_median": _quantile([run.seconds for run in mine], 0.5),
    }


def _cause(run: Run) -> str:
    """The status of a failed run, with the message of a crash; other reasons differ by field."""
    crashed = run.status == Status.CRASHED.label
    return f"{run.status} ({run.reason})" if crashed and run.reason else run.status


def _quantile(values: Sequence[float], share: float) -> float | None:
    return metrics.finite(metrics.quantile(values, share))


def table(report: Mapping[str, Any]) -> Table:
    """A row for each planner, in groups by what the planners know."""
    budget, changes = report["budget_seconds"], FieldChanges.of_json(report)
    where = "where a planner searches on"
    changed = f", {changes}" if changes else ""
    searched = "their own budgets" if budget is None else f"{budget:g} s {where}"
    rows = terminal_tables.empty_table(
        f"Planners on the same {len(report['fields'])} fields{changed}, {searched}",
        "planner",
        "solved",
        "95 % interval",
        "false",
        "raw gap [%]",
        "gap [%]",
        "90 %",
        "99 %",
        "turn [m]",
        "first [ms]",
        "total [s]",
        caption=_caption(report),
    )
    for heading, group in grouped(report["planners"], lambda one: one["knows"]):
        add_group(rows, heading, map(_cells, group))
    return rows


def _cells(one: Mapping[str, Any]) -> tuple[str, ...]:
    low, high = (f"{100 * one[key]:.1f}" for key in ("success_low", "success_high"))
    gaps = ("raw_gap_median", "gap_median", "gap_90", "gap_99")
    return (
        one["planner"],
        f"{one['successes']}/{one['runs']}",
        f"{low} to {high}",
        str(one["failures"].get(FALSE_SUCCESS, 0)),
        *(decimal(one[key], 2, 100.0) for key in gaps),
        decimal(one["min_turn_radius_median"], 2),
        decimal(one["seconds_first_median"], 1, 1e3),
        decimal(one["seconds_median"], 3),
    )


def _caption(report: Mapping[str, Any]) -> str:
    caption = (
        "gap: length / shortest length - 1 after the fit, median, 90th and 99th percentile; raw "
        "gap: before the fit; turn: smallest turn radius; these are over successes alone, so a "
        "planner that fails on hard fields looks better. Interval: Wilson's, over fields. first: "
        "time until a route, or the path of planners without routes; infinite for failures. total: "
        "planning time with fit and certification. false: reported as solved, but not feasible; "
        "they count as failures."
    )
    if report["workers"] > 1:
        caption += f" Times measured with {report['workers']} workers at once are not comparable."
    return f"{caption}\n{LEGEND}"
