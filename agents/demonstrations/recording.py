"""Recording demonstrations: fly an expert, write successful flights, and count failed ones."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from agents.demonstrations import minari_store as dataset
from agents.demonstrations import work
from agents.demonstrations.episode import make_environment, record
from agents.demonstrations.work import Request
from agents.runtime.chunk_store import ChunkStore
from agents.runtime.terminal import Terminal
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world import Field, State
from ferguson_gym.world.actions import Action

RANDOM_FLIGHTS = 100
"""Limit of flights with random actions, whose mean return is the score 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Results of an expert's flights."""

    flights: int
    """Number of successful flights, on which the next two rest."""
    steps: int
    mean_return: float
    """NaN without flights."""
    failed: dict[str, str]
    """Outcomes of failed flights by field, as labels."""

    def as_json(self) -> dict[str, Any]:
        """JSON values; the mean is null if there are no flights."""
        mean = None if math.isnan(self.mean_return) else self.mean_return
        return {**asdict(self), "mean_return": mean}

    def sentence(self) -> str:
        """A summary in words."""
        text = f"{self.flights} flights, {self.steps} steps"
        counts = Counter(self.failed.values())
        reasons = ", ".join(f"{count} {label}" for label, count in sorted(counts.items()))
        return text + (f"; {len(self.failed)} failed and left out ({reasons})" if counts else "")


def work_place(place: Path) -> Path:
    """The work directory beside a dataset; hidden, so that it is not mistaken for a dataset."""
    return place.with_name(f".{place.name}.part")


def make(
    request: Request,
    dataset_id: str,
    place: Path,
    workers: int,
    fresh: bool = False,
    terminal: Terminal | None = None,
) -> Tally:
    """Fly the missing demonstrations, then write the dataset.

    Args:
        request: expert, fields and environment.
        dataset_id: id of the dataset.
        place: its directory, from `minari_store.place_of`.
        workers: number of processes.
        fresh: whether to replace a dataset of this id and unfinished work of another request.
        terminal: shows progress.

    Raises:
        ValueError: the work directory holds another request's work.
        OSError: a worker died or the disk failed; finished chunks are kept.
        KeyboardInterrupt: finished chunks are kept.
    """
    store = work.open_store(work_place(place), request)
    if fresh:
        try:
            store.holds_work()
        except ValueError:  # work of another request; that of the same one would be the same again
            store.remove()
    missing = store.begin()
    left = sum(len(request.chunk(number)) for number in missing)
    with (terminal or Terminal()).bar() as progress:
        flying = progress.add_task("flights", total=len(request.fields))
        progress.advance(flying, len(request.fields) - left)
        for done in work.fly(store, request, missing, workers):
            progress.advance(flying, done)
        tally = count(store)
        if tally.flights:
            label = _label(request, dataset_id, tally)
            good = (episode for episode in work.flown(store) if episode.outcome.success)
            writing = progress.add_task("writing", total=tally.flights)
            for done in dataset.write(label, good, store.place / "staging", fresh):
                progress.advance(writing, done)
    store.remove()
    return tally


def count(store: ChunkStore) -> Tally:
    """Tally the flights of a work directory in which no chunk is missing."""
    returns: list[float] = []
    steps, failed = 0, {}
    for episode in work.flown(store):
        if episode.outcome.success:
            returns.append(float(episode.rewards.sum()))
            steps += len(episode.actions)
        else:
            failed[episode.field] = episode.outcome.label
    mean = float(np.mean(returns)) if returns else float("nan")
    return Tally(flights=len(returns), steps=steps, mean_return=mean, failed=failed)


def _label(request: Request, dataset_id: str, tally: Tally) -> dataset.Label:
    fields, specs = request.fields[:RANDOM_FLIGHTS], ", ".join(request.specs)
    return dataset.Label(
        dataset_id=dataset_id,
        expert=request.expert,
        arguments=request.environment,
        description=f"Flights of {request.expert} through {specs}, from start to goal.",
        random_return=random_return(request.environment, fields),
        expert_return=tally.mean_return,
        random_flights=len(fields),
        more=request.as_json() | {"flights": tally.flights, "failed": tally.failed},
    )


def random_return(arguments: dict[str, Any], fields: list[str]) -> float:
    """Mean return of uniformly random actions, one flight through each field."""
    env, policy = make_environment(arguments), _Random()
    return float(np.mean([record(env, name, policy).rewards.sum() for name in fields]))


@dataclass(slots=True)
class _Random:
    """A policy of uniformly random actions, different in each flight."""

    flights: itertools.count[int] = field(default_factory=itertools.count)
    stream: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def begin(self, field: Field, seed: int) -> None:
        """Seed the stream of this flight."""
        self.stream = np.random.default_rng([seed, next(self.flights)])

    def act(self, observation: Observation, vehicle: State) -> Action:
        """A random action."""
        return self.stream.uniform(-1.0, 1.0, 4).astype(np.float32)
