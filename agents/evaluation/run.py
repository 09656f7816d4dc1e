"""`ferguson evaluate`: every policy through the same fields, in the environment."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from agents.evaluation import provenance, results, tables
from agents.evaluation import summary as summaries
from agents.evaluation import work as evaluation_work
from agents.evaluation.chunks import to_draw
from agents.evaluation.records import Record, flight_of
from agents.evaluation.report.page import REPORT, write_report
from agents.evaluation.request import Request, Source, field_of
from agents.evaluation.statistics import summarise
from agents.evaluation.timing import Timing, measure
from agents.evaluation.work import Work
from agents.flights.flight import Flight
from agents.plots.flight_grid import draw_flights, picture_of
from agents.plots.policy_comparison import COLOURS, draw_comparison
from agents.runtime.chunk_store import read_json
from agents.runtime.executors import Backend
from agents.runtime.interrupts import defer_interrupt
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world.field import Field

FILES = ("flights.csv", "timings.csv", "paths.npz", "summary.json", "report.html")
"""What a directory of results may hold beside pictures."""
COMPARISON = "comparison.png"
"""All policies over the first fields, if there are several, and not more than colours."""


def evaluate(
    policies: Sequence[str],
    fields: Sequence[Source],
    seeds: Sequence[int],
    directory: str | Path,
    workers: int = 1,
) -> None:
    """As `run`, with processes on this machine."""
    request = Request(policies=policies, fields=fields, seeds=seeds)
    run(request, Path(directory), Backend(workers=workers))


def run(
    request: Request,
    directory: Path,
    backend: Backend,
    *,
    together: int | None = None,
    command: str | None = None,
    fresh: bool = False,
    terminal: Terminal | None = None,
) -> None:
    """Fly what is missing, write the results into a directory, show the tables.

    Where the results are there already, nothing is flown, and they are shown again.

    Args:
        request: which flights.
        directory: of the results; made if need be.
        backend: who flies.
        together: flights of an agent that are in the air at a time; None: a good number.
        command: that does the same again.
        fresh: whether to start over, whatever lies there.
        terminal: that shows them, and how far the flights are.

    Raises:
        ValueError: the directory holds something else.
        OSError: a worker died again and again, the scheduler was lost, or the disk refuses.
        KeyboardInterrupt: what is finished is kept, and flown on by the same call.
    """
    directory.mkdir(parents=True, exist_ok=True)
    work = Work(directory, request)
    if fresh:
        _clear(work)
    terminal = terminal or Terminal()
    if evaluation_work.check(work):
        work.store.remove()
        _show(directory, terminal)
        terminal.note(f"{directory} holds these results already; --fresh flies again")
        return
    with terminal.bar() as progress:
        task = progress.add_task("flights", total=request.flights)
        missing = work.begin()
        progress.advance(task, request.flights - sum(map(len, missing)))
        for done in evaluation_work.fly(work, missing, backend, together):
            progress.advance(task, done)
    flown = _write(work)
    timings = []
    with terminal.still_bar() as progress:
        for policy in progress.track(request.policies, description="times"):
            with defer_interrupt():
                timings.append(measure(request, policy))
    made = {"command": command, "backend": backend.name, "workers": backend.workers}
    _summarise(work, flown, timings, made | {"batch": together})
    names = sorted(path.name for path in work.staging.iterdir())
    for name in sorted(names, key="summary.json".__eq__):  # which vouches for the others
        (work.staging / name).replace(directory / name)
    work.store.remove()
    _show(directory, terminal)
    terminal.note(f"wrote {', '.join(names)} to {directory}; see {directory / REPORT}")


def _show(directory: Path, terminal: Terminal) -> None:
    text = (directory / "summary.json").read_text("utf-8")
    terminal.show_json(text.rstrip())
    terminal.show(*tables.of_summary(json.loads(text)))


def _write(work: Work) -> list[Record]:
    """Write files and pictures where they wait to be moved into their place."""
    work.staging.mkdir(exist_ok=True)
    flown = list(results.write_flights(work.staging, work.records()))
    results.write_paths(work.staging / "paths.npz", flown, _controls(work))
    drawn = {policy: _drawn(work, policy) for policy in work.request.policies}
    for policy, flights in drawn.items():
        title = f"{policy}, policy seed {work.request.seeds[0]}"
        draw_flights(flights, work.staging / picture_of(policy), title=title)
    if 1 < len(drawn) <= len(COLOURS):
        draw_comparison(list(zip(*drawn.values(), strict=True)), work.staging / COMPARISON)
    return flown


def _controls(work: Work) -> Iterator[Array]:
    for chunk in work.request.chunks:
        yield work.kept(chunk)["control"]


def _drawn(work: Work, policy: str) -> list[Flight]:
    """The first flights of a policy, to be drawn."""
    chunks = [chunk for chunk in work.request.chunks if chunk.policy == policy]
    flights = []
    for index in to_draw(work.request):
        (chunk,) = (one for one in chunks if one.first <= index < one.last)
        field = field_of(work.request.flight(index)[0])
        flights.append(flight_of(*work.trace(chunk, index), field))
    return flights


def _summarise(
    work: Work, flown: Sequence[Record], timings: Sequence[Timing], made: dict[str, Any]
) -> None:
    """Write summary.json: how the results were made, and what came out."""
    summary = {
        **made,
        "configuration": work.request.configuration,
        "machine": provenance.facts(),
        "flights": len(flown),
        "policies": [_told(work.request, timing, flown) for timing in timings],
        "statistics": summarise(work.staging),
        "shields": summaries.shields(flown),
        "paper": summaries.on_paper(flown),
    }
    names = {path.name for path in work.staging.iterdir()}
    summary["files"] = sorted({"summary.json", "report.html", *names})
    with atomic_write(work.staging / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", "utf-8")
    drawn = {one.name: one for one in work.request.fields if isinstance(one, Field)}
    write_report(work.staging, drawn, summary["statistics"])


def _told(request: Request, timing: Timing, flown: Sequence[Record]) -> dict[str, Any]:
    """Of a policy, its part of the summary; times are in seconds."""
    policy = timing.policy
    return {
        "policy": policy,
        "models": request.configuration["policies"][policy],
        "stopped_by_clock": provenance.stopped_by_clock(policy),
        "flight_seconds": sum(flight.seconds for flight in flown if flight.policy == policy),
        **timing.told(),
    }


def _clear(work: Work) -> None:
    """Remove unfinished work, and results."""
    work.store.remove()
    listed = read_json(work.results / "summary.json").get("files", [])
    for name in {*FILES, *(name for name in listed if isinstance(name, str))}:
        if Path(name).name == name:
            (work.results / name).unlink(missing_ok=True)
