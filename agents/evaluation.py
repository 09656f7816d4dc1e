"""`ferguson evaluate`: every policy through the same fields, in the environment."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

from joblib import Parallel, delayed
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from agents import results, tables
from agents.flights import Flight, fly_by_name
from agents.pictures import draw_flights, picture_of
from ferguson_gym.fields import Field

PANELS = 4
"""Fields drawn in a policy's picture, the first ones."""


def flights(
    policies: Sequence[str], fields: Sequence[Field], seeds: Sequence[int], workers: int
) -> Iterator[Flight]:
    """Fly every policy, field and seed, in this order whatever the number of workers."""
    tasks = itertools.product(policies, fields, seeds)
    parallel = Parallel(n_jobs=workers, return_as="generator")
    flown: Iterator[Flight] = parallel(delayed(fly_by_name)(*task) for task in tasks)
    return flown


def evaluate(
    policies: Sequence[str],
    fields: Sequence[Field],
    seeds: Sequence[int],
    directory: Path,
    workers: int = 1,
) -> list[Flight]:
    """Fly, write the results into a directory, draw the first fields, print the tables."""
    directory.mkdir(parents=True, exist_ok=True)
    number = len(policies) * len(fields) * len(seeds)
    flown: list[Flight] = []
    with _progress() as progress:
        task = progress.add_task("flights", total=number)
        for flight in flights(policies, fields, seeds, workers):
            flown.append(flight)
            progress.advance(task)
    results.write(directory, flown)
    for policy in policies:
        shown = [f for f in flown if f.policy == policy and f.seed == seeds[0]][:PANELS]
        title = f"{policy}, policy seed {seeds[0]}"
        draw_flights(shown, directory / picture_of(policy), title=title)
    console = tables.console()
    console.print(tables.summary(flown))
    if (shields := tables.shields(flown)) is not None:
        console.print(shields)
    if (paper := tables.paper_table(flown)) is not None:
        console.print(paper)
    pictures = ", ".join(map(picture_of, policies))
    console.print(
        f"wrote flights.csv, timings.csv, paths.npz, {pictures} to {directory}", markup=False
    )
    return flown


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )
