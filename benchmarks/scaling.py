"""How times grow with the number of discs, 50 to 100,000: a table and a picture.

Run it from a checkout: `.venv/bin/python benchmarks/scaling.py [FIELDS] [SECONDS]`. Times
are medians of FIELDS fields (3), the least of three where one takes less than a second. A planner
that needs more than SECONDS (60) for one is not asked about more discs. Start and goal are 141 m
apart. In the `wider` fields, 120 m square with 50 discs, discs stay as they are and the bounds
grow; in the `finer` ones the bounds stay and the discs shrink. Compilation is not counted.
"""

from __future__ import annotations

import math
import multiprocessing
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from matplotlib.ticker import FuncFormatter

import planners
from agents.benchmarks.planners.styles import styles_of
from agents.plots.figure import figure_file
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import DistanceToGoal, shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import initial_state
from planners.whole_path.astar import AStar
from planners.whole_path.ompl import Ompl

NUMBERS = (50, 200, 1000, 3000, 10_000, 30_000, 100_000)
SIDE = 120.0
"""Of the smallest field [m]."""
PICTURE = Path("docs/images/scaling.png")
WARM_UP = 300.0
"""Time that a process has to start, import and compile [s]."""


def wider(seed: int, number: int) -> Field:
    """A field of the usual density and discs, as large as a number of discs makes it.

    The discs in the middle are the same for all numbers.
    """
    side, spacing = SIDE * math.sqrt(number / NUMBERS[0]), SIDE / math.sqrt(NUMBERS[0])
    stream = np.random.default_rng(seed)
    low = 0.5 * (side - SIDE)
    centers = low + stream.uniform(0.0, SIDE, (NUMBERS[0], 2))
    while len(centers) < number:
        more = stream.uniform(0.0, side, (number, 2))
        beside = ((more < low) | (more > low + SIDE)).any(axis=1)
        centers = np.concatenate([centers, more[beside]])[:number]
    return _field(seed, centers, side, spacing)


def finer(seed: int, number: int) -> Field:
    """A field of the usual size and density with a number of discs."""
    centers = np.random.default_rng(seed).uniform(0.0, SIDE, (number, 2))
    return _field(seed, centers, SIDE, SIDE / math.sqrt(number))


def _field(seed: int, centers: Array, side: float, spacing: float) -> Field:
    """Discs with radii of 0.1 to 0.3 times their spacing [m], in a square of a side [m]."""
    ends = 0.5 * side + np.array([[-50.0, -50.0], [50.0, 50.0]])
    radii = np.random.default_rng([seed, 1]).uniform(0.1, 0.3, len(centers)) * spacing
    discs = Obstacles.discs(centers, radii)
    free = (discs.signed_distance(ends) >= 0.05 * spacing).all(axis=0)
    return Field(
        name=f"{len(centers)} discs",
        obstacles=discs.only(free),
        start=ends[0],
        goal=ends[1],
        bounds=(0.0, side),
    )


def exact(field: Field) -> float:
    """Time of the exact shortest path [s]."""
    return _seconds(lambda: shortest_path(field))


def query(field: Field) -> float:
    """Time of a distance to go [s]: of 20 points about 30 m ahead, after one from the start."""
    togo = DistanceToGoal(field)
    path = togo.path(field.start)
    assert path is not None
    points = path.points(0.25)[120:140] + np.random.default_rng(0).normal(size=(20, 2))
    return _seconds(lambda: togo(points)) / len(points)


def first_step(field: Field) -> float:
    """Time of the first step of `guided` [s]."""
    return _steps(field)[0]


def later_steps(field: Field) -> float:
    """Mean time of its later steps [s]."""
    return float(np.mean(_steps(field)[1:]))


def astar(field: Field) -> float:
    """Time of a route by A* on a grid [s]."""
    return _seconds(lambda: AStar().route(field, initial_state(field).vehicle, 0))


def bit_star(field: Field) -> float:
    """Time of a route by BIT* [s], 40 batches."""
    router = Ompl(algorithm="bit-star", budget=planners.interface.Iterations(40), timeout=1e4)
    return _seconds(lambda: router.route(field, initial_state(field).vehicle, 0))


def _seconds(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    result = action()
    return time.perf_counter() - began if result is not None else math.nan


def _steps(field: Field) -> list[float]:
    plan = planners.make("guided").plan(field, initial_state(field), 0)
    return [decision.report.seconds for decision in plan.decisions]


COLUMNS = {
    "exact path": (exact, (wider, finer)),
    "distance to go": (query, (wider, finer)),
    "guided, first step": (first_step, (wider,)),
    "guided, later steps": (later_steps, (wider,)),
    "astar": (astar, (wider, finer)),
    "bit-star": (bit_star, (wider, finer)),
}
"""What is measured, and in which fields."""


def serve(link: Connection, question: Callable[[Field], float], kind: Callable[..., Field]) -> None:
    """Send times [s] for numbers of discs that come in; the first result means ready."""
    for number in (50, 300):
        question(kind(100, number))
    link.send(0.0)
    while True:
        seed, number = link.recv()
        times = [question(kind(seed, number))]
        while len(times) < 3 and times[0] < 1.0:
            times.append(question(kind(seed, number)))
        link.send(min(times))


def measure(name: str, kind: Callable[..., Field], fields: int, most: float) -> list[float]:
    """Median times [s] for all numbers of discs; NaN without a result in time."""
    ours, theirs = (context := multiprocessing.get_context("spawn")).Pipe()
    process = context.Process(target=serve, args=(theirs, COLUMNS[name][0], kind))
    process.start()
    medians = [math.nan] * len(NUMBERS)
    if ours.poll(WARM_UP):
        ours.recv()
        for k, number in enumerate(NUMBERS):
            times = []
            for seed in range(fields):
                ours.send((seed, number))
                if not ours.poll(most):
                    break
                times.append(ours.recv())
            if len(times) < fields:
                break
            # without a route, NaN, which is sorted to the end
            medians[k] = float(np.sort(times)[(fields - 1) // 2])
            print(f"{kind.__name__}, {name}, {number}: {medians[k]:.4f} s", file=sys.stderr)
    process.kill()
    process.join()
    return medians


def shown(seconds: float) -> str:
    """A time with two digits, and its unit."""
    if math.isnan(seconds):
        return "-"
    value, unit = (1e3 * seconds, "ms") if seconds < 1.0 else (seconds, "s")
    return f"{float(f'{value:.2g}'):g} {unit}"


def draw(results: dict[tuple[str, str], list[float]]) -> None:
    """Draw times over numbers of discs, for both kinds of fields side by side."""
    styles = styles_of(list(COLUMNS))
    with figure_file(PICTURE, 8.2, 3.8) as figure:
        plots = figure.subplots(1, 2, sharey=True)
        for axes, kind in zip(plots, ("wider", "finer"), strict=True):
            for name, style in styles.items():
                if (times := results.get((kind, name))) is not None:
                    axes.plot(NUMBERS, times, color=style.colour, lw=1.0)
                    axes.plot(NUMBERS, times, ls="", label=name, **style.spot)
            axes.set(xscale="log", yscale="log", xlabel="discs", title=f"{kind} fields")
            axes.grid(color="#e6e9ee", lw=0.6)
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: shown(value)))
        handles, labels = plots[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=6, frameon=False)


def main(fields: int, most: float) -> None:
    """Measure, print a table for each kind of fields, and write the picture."""
    results = {}
    for kind in (wider, finer):
        for name, (_, kinds) in COLUMNS.items():
            if kind in kinds:
                results[kind.__name__, name] = measure(name, kind, fields, most)
    for kind in (wider, finer):
        names = [name for name in COLUMNS if (kind.__name__, name) in results]
        print(f"\n| discs, {kind.__name__} fields | {' | '.join(names)} |")
        print("| --- " * (len(names) + 1) + "|")
        for k, number in enumerate(NUMBERS):
            cells = [shown(results[kind.__name__, name][k]) for name in names]
            print(f"| {number:,} | {' | '.join(cells)} |")
    draw(results)


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 3,
        float(sys.argv[2]) if len(sys.argv) > 2 else 60.0,
    )
