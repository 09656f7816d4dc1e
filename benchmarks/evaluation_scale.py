"""Time and memory of large evaluations, from the command to its results.

Run it from a checkout with the extra `agents`, on Linux, on a quiet machine:

    .venv/bin/python benchmarks/evaluation_scale.py --runs 3
    .venv/bin/python benchmarks/evaluation_scale.py \
        dagger-ppo:standard/validation:0-1999 dagger-ppo:standard/validation:0-19999

By default 10,000 flights of a learned agent and 1,000 of `guided`. Each is a `ferguson evaluate` of
its own, with start-up, exact lengths, statistics, pictures and report; kernels are compiled before.
Memory is the sum of the proportional set sizes (PSS) of the command and of all processes below it,
so that shared pages count once, sampled twice a second; the second figure is the process of the
command alone.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

TARGETS = ("dagger-ppo:standard/validation:0-9999", "guided:standard/validation:0-999")
"""Evaluations that should take at most a minute on two cores."""
PAUSE = 0.5
"""Time between samples of memory [s]."""


@dataclass(frozen=True, slots=True)
class Run:
    """One evaluation."""

    flights: int
    seconds: float
    peak: float
    """Of all processes together [MB]."""
    main: float
    """Of the one that was started [MB]."""


def evaluate(policy: str, fields: str, workers: int) -> Run:
    """Evaluate a policy in processes of its own.

    Raises:
        CalledProcessError: it failed.
    """
    with tempfile.TemporaryDirectory() as place:
        words = ["--policy", policy, "--fields", fields, "--workers", str(workers), "--out", place]
        command = [sys.executable, "-m", "agents.cli.main", "evaluate", "--quiet", *words]
        began = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as running:
            sizes: list[tuple[float, float]] = [(0.0, 0.0)]
            ended = threading.Event()

            def look() -> None:
                while not ended.wait(PAUSE):
                    each = [held(process) for process in tree(running.pid)]
                    sizes.append((sum(each), each[0]))

            looker = threading.Thread(target=look)
            looker.start()
            status = running.wait()
            seconds = time.perf_counter() - began
            ended.set()
            looker.join()
        if status:
            raise subprocess.CalledProcessError(status, command)
        with (Path(place) / "flights.csv").open(encoding="utf-8") as file:
            flights = sum(1 for _ in file) - 1
        peak, main = np.max(sizes, axis=0)
        return Run(flights, seconds, float(peak), float(main))


def tree(root: int) -> Iterator[int]:
    """A process and all below it, as long as they live."""
    yield root
    try:
        for task in Path(f"/proc/{root}/task").iterdir():
            for child in (task / "children").read_text().split():
                yield from tree(int(child))
    except OSError:  # it has ended
        return


def held(process: int) -> float:
    """Proportional set size of a process [MB]; 0 when it has ended."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith("Pss:")) * 1024 / 1e6


def main() -> None:
    """Read the command line, evaluate, print a row for each evaluation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument(
        "wanted", nargs="*", metavar="POLICY:FIELDS", help=f"default: {' '.join(TARGETS)}"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=int, default=1, help="times that each is done")
    given = parser.parse_args()
    table = Table("policy, fields", "flights", "seconds", "flights a second", "MB", "MB, main")
    wanted = [tuple(one.split(":", 1)) for one in given.wanted or TARGETS]
    for policy, fields in dict.fromkeys(wanted):
        small = fields.partition(":")[0] + ":0-1"
        evaluate(policy, small, given.workers)  # compiles what is not compiled yet
        runs = [evaluate(policy, fields, given.workers) for _ in range(given.runs)]
        table.add_row(
            f"{policy}, {fields}",
            f"{runs[0].flights:,}",
            _spread([run.seconds for run in runs], ".1f"),
            _spread([run.flights / run.seconds for run in runs], ".0f"),
            _spread([run.peak for run in runs], ".0f"),
            _spread([run.main for run in runs], ".0f"),
        )
    Console(width=120).print(table)


def _spread(values: list[float], form: str) -> str:
    """The median and the range."""
    text = f"{np.median(values):{form}}"
    if len(values) > 1:
        text += f" ({min(values):{form}} to {max(values):{form}})"
    return text


if __name__ == "__main__":
    main()
