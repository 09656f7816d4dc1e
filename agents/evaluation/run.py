"""`ferguson evaluate`: fly every policy through the same fields, and write the results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.evaluation import provenance, results, tables
from agents.evaluation import summary as summaries
from agents.evaluation import work as evaluation_work
from agents.evaluation.chunks import drawn_flights
from agents.evaluation.report.page import REPORT, write_page
from agents.evaluation.request import Request, Source
from agents.evaluation.statistics import summary as statistics_of
from agents.evaluation.timing import Timing, measure
from agents.evaluation.work import FlownPaths, Work
from agents.flights.flight_table import FlightTable
from agents.plots.flight_grid import draw_flights, picture_of
from agents.plots.policy_comparison import COLOURS, draw_comparison
from agents.policies import make_policy
from agents.runtime.chunk_store import read_json
from agents.runtime.executors import Backend
from agents.runtime.interrupts import defer_interrupt
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world import Field
from planners.interface import knowledge_of

FILES = ("flights.csv", "timings.csv", "paths.npz", "summary.json", REPORT)
"""Files in a directory of results beside pictures."""
COMPARISON = "comparison.png"
"""Picture of all policies on the first fields, if there are several and not more than colours."""


def evaluate(
    policies: Sequence[str],
    fields: Sequence[Source],
    seeds: Sequence[int],
    directory: str | Path,
    workers: int = 1,
) -> dict[str, Any]:
    """As `run`, with processes on this machine."""
    request = Request(policies=policies, fields=fields, seeds=seeds)
    return run(request, Path(directory), Backend(workers=workers))


def run(
    request: Request,
    directory: Path,
    backend: Backend,
    *,
    batch: int | None = None,
    command: str | None = None,
    fresh: bool = False,
    terminal: Terminal | None = None,
) -> dict[str, Any]:
    """Fly the missing flights, write the results into a directory, show the tables.

    If the directory holds the results already, nothing is flown, and they are shown again. Returns
    the object of summary.json.

    Args:
        request: Which flights.
        directory: Of the results; it is made if need be.
        backend: The processes that fly.
        batch: Flights of an agent at a time; None: `agents.flights.batched.BATCH`.
        command: The command that makes the same results again.
        fresh: Whether to remove the results and unfinished work in the directory first.
        terminal: Shows the tables, and the progress of flights.

    Raises:
        ValueError: The directory holds the results of another request.
        OSError: A worker died again and again, the connection to the scheduler was lost, or a
            file cannot be written.
        KeyboardInterrupt: Finished chunks are kept, and the same call resumes the work.
    """
    directory.mkdir(parents=True, exist_ok=True)
    work = Work(directory, request)
    if fresh:
        _clear(work)
    terminal = terminal or Terminal()
    if evaluation_work.is_finished(work):
        work.store.remove()
        text = (directory / "summary.json").read_text("utf-8")
        found: dict[str, Any] = json.loads(text)
        _show(found, text, terminal)
        terminal.note(f"{directory} holds these results already; --fresh flies again")
        return found
    with terminal.bar() as progress:
        task = progress.add_task("flights", total=request.flights)
        missing = work.begin()
        progress.advance(task, request.flights - sum(map(len, missing)))
        for done in evaluation_work.fly(work, missing, backend, batch):
            progress.advance(task, done)
    work.staging.mkdir(exist_ok=True)
    flights = work.table()
    _write(work, flights)
    made = {"command": command, "backend": backend.name, "workers": backend.workers, "batch": batch}
    found = made | _summary(work, flights, _timings(request, terminal))
    text = _write_summary(work, flights, found)
    names = sorted(path.name for path in work.staging.iterdir())
    for name in sorted(names, key="summary.json".__eq__):  # last, since it completes the results
        (work.staging / name).replace(directory / name)
    work.store.remove()
    _show(found, text, terminal)
    terminal.note(f"wrote {', '.join(names)} to {directory}; see {directory / REPORT}")
    return found


def _show(summary: Mapping[str, Any], text: str, terminal: Terminal) -> None:
    terminal.show_json(text.rstrip())
    terminal.show(*tables.of_summary(summary))


def _timings(request: Request, terminal: Terminal) -> list[Timing]:
    timings = []
    with terminal.still_bar() as progress:
        for policy in progress.track(request.policies, description="times"):
            with defer_interrupt():
                timings.append(measure(request, policy))
    return timings


def _write(work: Work, flights: FlightTable) -> None:
    """Write tables, paths and pictures into the staging directory."""
    results.write_tables(work.staging, flights)
    controls = (work.columns(chunk)["control"] for chunk in work.request.chunks)
    results.write_paths(work.staging / "paths.npz", flights, controls)
    shown = drawn_flights(work.request)
    drawn = {policy: work.drawn(policy, shown) for policy in work.request.policies}
    for policy, panels in drawn.items():
        title = f"{policy}, policy seed {work.request.seeds[0]}"
        draw_flights(panels, work.staging / picture_of(policy), title=title)
    if 1 < len(drawn) <= len(COLOURS):
        draw_comparison(list(zip(*drawn.values(), strict=True)), work.staging / COMPARISON)


def _summary(work: Work, flights: FlightTable, timings: Sequence[Timing]) -> dict[str, Any]:
    """The object of summary.json: how the results were made, and the results."""
    names = {path.name for path in work.staging.iterdir()}
    knows = {name: knowledge_of(make_policy(name)).label for name in work.request.policies}
    return {
        "configuration": work.request.configuration,
        "machine": provenance.facts(),
        "flights": len(flights),
        "policies": [_of_policy(work.request, timing, flights) for timing in timings],
        "statistics": statistics_of(flights, knows=knows),
        "shields": summaries.shields(flights),
        "paper": summaries.on_paper(flights),
        "unreachable": summaries.unreachable(work.request, flights),
        "files": sorted({"summary.json", REPORT, *names}),
    }


def _of_policy(request: Request, timing: Timing, flights: FlightTable) -> dict[str, Any]:
    """A policy's part of the summary; times are in seconds."""
    policy = timing.policy
    mine = flights.policy == flights.policies.index(policy)
    return {
        "policy": policy,
        "models": request.configuration["policies"][policy],
        "stopped_by_clock": provenance.stopped_by_clock(policy),
        "flight_seconds": float(flights["seconds"][mine].sum()),
        **timing.summary(),
    }


def _write_summary(work: Work, flights: FlightTable, summary: Mapping[str, Any]) -> str:
    """Write summary.json and report.html into the staging directory; returns the JSON text."""
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    with atomic_write(work.staging / "summary.json") as temporary:
        temporary.write_text(text, "utf-8")
    fields = {one.name: one for one in work.request.fields if isinstance(one, Field)}
    paths = FlownPaths(work, flights["segments"])
    write_page(work.staging / REPORT, flights, paths, summary, fields)
    return text


def _clear(work: Work) -> None:
    """Remove unfinished work and results."""
    work.store.remove()
    listed = read_json(work.results / "summary.json").get("files", [])
    for name in {*FILES, *(name for name in listed if isinstance(name, str))}:
        if Path(name).name == name:
            (work.results / name).unlink(missing_ok=True)
