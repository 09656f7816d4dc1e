"""`ferguson bench env`: steps per second of our environments beside Gymnasium's CartPole.

Each round runs a short slice of every environment, so that a slow phase of the machine affects all
equally. Ratios are taken within rounds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.progress import Progress
from rich.table import Table

from agents.benchmarks.environment import startup
from agents.benchmarks.environment.drivers import DEVIATION, Entry, Slice
from agents.runtime import provenance, terminal_tables
from agents.runtime.csv_files import write_csv
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.runtime.optional_dependencies import installing


class Row(NamedTuple):
    """An environment, and how many copies are stepped together."""

    environment: str
    number: int

    def __str__(self) -> str:
        return self.environment if self.number == 1 else f"{self.environment} {self.number}"


RATIOS = (
    (Row("ObstacleField", 1), Row("CartPole-v1", 1)),
    (Row("ObstacleField vector", 256), Row("CartPole-v1 vector", 256)),
    (Row("ObstacleField vector", 2048), Row("CartPole-v1 vector", 2048)),
    (Row("ObstacleField vector", 16), Row("ObstacleField SyncVectorEnv", 16)),
    (Row("ObstacleField vector", 256), Row("ObstacleField SubprocVecEnv", 2)),
)
"""Pairs whose steps per second are compared."""

Slices = Mapping[Row, Sequence[Slice]]
"""The slices of each environment, one for each round."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Settings of a measurement."""

    observation: str
    seconds: float
    """Time of a slice [s]."""
    rounds: int
    seed: int
    first_step: bool
    """Whether a first step with compilation is timed, too."""


def bench(entries: Sequence[Entry], request: Request, out: Path | None, terminal: Terminal) -> None:
    """Measure, print the tables, and write steps.csv and summary.json."""
    present = [entry for entry in entries if not entry.missing]
    missing = [Row(entry.name, entry.number) for entry in entries if entry.missing]
    with terminal.still_bar() as progress:
        slices = measure(present, request, progress)
        progress.update(progress.task_ids[-1], description="fresh processes", refresh=True)
        fresh = startup.measure(request.observation, request.first_step)
    report = summary(slices, missing, fresh, request)
    terminal.show_json(json.dumps(report))
    for table in (speeds(report), ratios(report), starts(report)):
        terminal.show(table, "")
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write(slices, out / "steps.csv")
        with atomic_write(out / "summary.json") as temporary:
            temporary.write_text(json.dumps(report, indent=2) + "\n")
        terminal.note(f"wrote steps.csv, summary.json to {out}")


def measure(entries: Sequence[Entry], request: Request, progress: Progress) -> Slices:
    """Warm all environments up, then run a slice of each in every round.

    The progress bar is drawn between slices only, since a drawing thread would be timed.
    """
    drivers = []
    slices: dict[Row, list[Slice]] = {}
    with ExitStack() as stack:
        task = progress.add_task("", total=(1 + request.rounds) * len(entries))
        for entry in entries:
            row = Row(entry.name, entry.number)
            progress.update(task, description=f"warming up: {row}", refresh=True)
            rng = np.random.default_rng(request.seed)
            driver = entry.driver(stack.enter_context(entry.make()), entry.actions(rng))
            entry.warm_up(driver, rng)
            driver.run(request.seconds)
            drivers.append((row, driver))
            slices[row] = []
            progress.advance(task)
        for k in range(request.rounds):
            progress.update(task, description=f"round {k + 1} of {request.rounds}")
            for row, driver in drivers:
                progress.refresh()
                slices[row].append(driver.run(request.seconds))
                progress.advance(task)
    return slices


def speed(slices: Sequence[Slice]) -> Array:
    """Steps per second of each round (rounds,)."""
    return np.array([one.steps / one.seconds for one in slices])


def summary(
    slices: Slices, missing: Sequence[Row], fresh: Mapping[str, float | None], request: Request
) -> dict[str, Any]:
    """The content of summary.json: settings, results, machine and versions."""
    environments = []
    for row, measured in slices.items():
        steps, flights = sum(s.steps for s in measured), sum(s.flights for s in measured)
        rates = {"steps_per_second": _spread(speed(measured))}
        each = {"steps_a_flight": steps / flights if flights else None}
        environments.append(row._asdict() | rates | each)
    compared = [
        {"of": of._asdict(), "to": to._asdict(), **_spread(speed(slices[of]) / speed(slices[to]))}
        for of, to in RATIOS
        if of in slices and to in slices
    ]
    return {
        **asdict(request),
        "environments": environments,
        "not_installed": [row._asdict() for row in missing],
        "ratios": compared,
        "fresh_process": dict(fresh),
        **provenance.facts("numpy", "numba", "gymnasium"),
    }


def _spread(rounds: Array) -> dict[str, float]:
    least, greatest = float(rounds.min()), float(rounds.max())
    return {"median": float(np.median(rounds)), "least": least, "greatest": greatest}


def write(slices: Slices, path: Path) -> None:
    """Write steps.csv, a row for each slice."""
    rows = ([*row, k, *one] for row, each in slices.items() for k, one in enumerate(each))
    write_csv(path, [*Row._fields, "round", *Slice._fields], rows)


def speeds(report: Mapping[str, Any]) -> Table:
    """The table of speeds, a row for each environment."""
    caption = (
        f"medians of {report['rounds']} rounds of {report['seconds']:g} s, {report['threads']} "
        "threads; spread: greatest less least, part of the median. Resets are timed; compilation, "
        "the layout of fields and the drawing of actions are not. "
        f"Actions: normal, deviation {DEVIATION:g}; left or right for CartPole."
    )
    if report["not_installed"]:
        caption += f" What is not installed comes with {installing('agents')}."
    rows = terminal_tables.empty_table(
        f"Steps per second, observation {report['observation']}",
        "environment",
        "envs",
        "steps/s",
        "spread",
        "step [µs]",
        "steps/flight",
        caption=caption,
    )
    for one in report["environments"]:
        each, flight = one["steps_per_second"], one["steps_a_flight"]
        rows.add_row(
            one["environment"],
            str(one["number"]),
            f"{each['median']:,.0f}",
            f"{100 * (each['greatest'] - each['least']) / each['median']:.0f} %",
            f"{1e6 / each['median']:.2f}",
            terminal_tables.decimal(flight, 1),
        )
    for row in report["not_installed"]:
        blank = [terminal_tables.NONE] * 3
        rows.add_row(row["environment"], str(row["number"]), "not installed", *blank)
    return rows


def ratios(report: Mapping[str, Any]) -> Table:
    """The table of ratios, a row for each pair."""
    title, spread = "Ratios of steps per second", ("median", "least", "greatest")
    caption = "taken within rounds"
    rows = terminal_tables.empty_table(title, "environments", *spread, caption=caption)
    for one in report["ratios"]:
        cells = (one[key] for key in spread)
        rows.add_row(
            f"{Row(**one['of'])} : {Row(**one['to'])}",
            *(f"{cell:.{max(0, 2 - math.floor(math.log10(cell)))}f}" for cell in cells),
        )
    return rows


def starts(report: Mapping[str, Any]) -> Table:
    """The table of start-up times and memory of fresh processes."""
    fresh = report["fresh_process"]
    caption = f"times without the interpreter's own start; medians of {startup.STARTS}"
    rows = terminal_tables.empty_table("Fresh processes", "what", "took", caption=caption)
    for what, key, scale, unit in (
        ("import ferguson_gym", "import_seconds", 1.0, "s"),
        ("import to first step", "first_step_seconds", 1.0, "s"),
        ("import to first step, compiling (once)", "compile_seconds", 1.0, "s"),
        ("memory of a process with one environment", "process_bytes", 2.0**20, "MiB"),
        (f"memory that {startup.MANY} more add", "many_bytes", 2.0**20, "MiB"),
    ):
        if (value := fresh[key]) is not None:
            digits = 2 if unit == "s" else 0
            rows.add_row(what, f"{value / scale:.{digits}f} {unit}")
    return rows
