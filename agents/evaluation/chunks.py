"""Flying a chunk: the task that a worker receives, and the result that it returns.

Agents without a wrapper fly all fields of a chunk in one batch, so single decisions cannot be timed
there; `agents.evaluation.timing` measures them separately.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

from agents.evaluation import provenance
from agents.evaluation.request import Chunk, Request, Source, field_of, is_batched
from agents.flights import Flight, fly
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.flights.flight_table import Columns, columns_of
from agents.policies import PolicySpec
from agents.runtime.interrupts import raise_if_interrupted
from agents.runtime.kernels import compile_kernels, small_field

PANELS = 4
"""Fields in a policy's picture, the first ones."""
_LOCK = threading.Lock()
"""Clusters may run several chunks in one process; compiled code must fly one at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Flights of one policy; `chunk` is the number of their chunk."""

    chunk: int
    policy: str
    flights: Sequence[tuple[Source, int]]
    """Field and seed of each."""
    drawn: Sequence[bool]
    """Whether each appears in a picture."""
    changes: FieldChanges = UNCHANGED
    """Of all fields."""
    batch: int | None = None
    """Flights of an agent at a time; None: `agents.flights.batched.BATCH`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The flights of a task, and what flew them."""

    chunk: int
    columns: Columns
    versions: dict[str, str]
    """Versions of the libraries."""
    models: list[str]
    """Hashes of the models' files."""


def task_of(request: Request, chunk: Chunk, batch: int | None = None) -> Task:
    """The task that flies a chunk."""
    numbers = range(chunk.first, chunk.last)
    shown = drawn_flights(request)
    return Task(
        chunk=chunk.number,
        policy=chunk.policy,
        flights=[request.flight(k) for k in numbers],
        drawn=[k in shown for k in numbers],
        changes=request.changes,
        batch=batch,
    )


def drawn_flights(request: Request) -> range:
    """Indices of each policy's flights in its picture: the first fields, with the first seed."""
    return range(0, min(PANELS, len(request.fields)) * len(request.seeds), len(request.seeds))


def single_flights(task: Task) -> list[Task]:
    """A task of one flight for each flight of a task."""
    return [
        replace(task, flights=[flight], drawn=[drawn])
        for flight, drawn in zip(task.flights, task.drawn, strict=True)
    ]


def fly_task(task: Task) -> Result:
    """Fly a task; except for times, the result is a function of the task.

    Raises:
        ValueError: An agent cannot be loaded here.
        KeyboardInterrupt: After a flight, if Ctrl-C was deferred.
    """
    with _LOCK:
        compile_kernels()
        return Result(
            chunk=task.chunk,
            columns=_fly(task),
            versions=provenance.versions(),
            models=list(provenance.models(task.policy).values()),
        )


def _fly(task: Task) -> Columns:
    flights = _fly_batch(task) if is_batched(task.policy) else _fly_one_by_one(task)
    return columns_of(flights, task.drawn)


def _fly_one_by_one(task: Task) -> list[Flight]:
    flights = []
    for source, seed in task.flights:
        field = field_of(source, task.changes)
        try:
            flights.append(fly(task.policy, field, seed))
        except Exception as error:
            error.add_note(f"while {task.policy} flew the field {field.name}, seed {seed}")
            raise
        raise_if_interrupted()
    return flights


def _fly_batch(task: Task) -> list[Flight]:
    from agents.flights.batched import BATCH, fly_batch
    from agents.models.shipped_agents import find_agent
    from agents.policies.network_policy import network_policy

    place = find_agent(PolicySpec.parse(task.policy).agent)
    if place is None:
        raise ValueError(f"no agent {task.policy!r} on the machine of this worker")
    model = network_policy(place).model
    fly_batch(model, [small_field()])  # compiles what the first batch needs, outside the timing
    fields = [field_of(source, task.changes) for source, _ in task.flights]
    flights = fly_batch(model, fields, task.batch or BATCH, name=task.policy)
    return [replace(one, seed=seed) for one, (_, seed) in zip(flights, task.flights, strict=True)]
