"""Flying a chunk: what a worker is handed, and what it gives back.

Agents that fly alone fly the fields of a chunk as a batch. Their decisions have no times of their
own then, and a flight's seconds are an equal share of the batch's; `agents.evaluation.timing`
measures what decisions cost.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

from agents.evaluation import provenance, records
from agents.evaluation.records import Pack, Record, Trace, record_of, trace_of
from agents.evaluation.request import Chunk, Request, Source, field_of, is_batched
from agents.flights.flight import fly
from agents.policies.spec import PolicySpec
from agents.runtime.interrupts import raise_if_interrupted
from agents.runtime.kernels import compile_kernels, small_field

PANELS = 4
"""Fields drawn in a policy's picture, the first ones."""
_ONE_AT_A_TIME = threading.Lock()
"""Clusters may give a process several chunks at once; compiled code may not fly them so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Flights of one policy."""

    chunk: int
    """Number of the chunk that they belong to."""
    policy: str
    flights: Sequence[tuple[Source, int]]
    """Field and seed of each."""
    first: int
    """Index of the first among those of the policy."""
    drawn: Sequence[bool]
    """Whether each will be drawn."""
    together: int | None = None
    """Flights of an agent in the air together; None: `agents.flights.batched.BATCH`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of a task."""

    chunk: int
    flown: Pack
    versions: dict[str, str]
    """Of the libraries it was flown with."""
    models: list[str]
    """Hashes of the models' files."""


def task_of(request: Request, chunk: Chunk, together: int | None = None) -> Task:
    """The task that flies a chunk."""
    numbers = range(chunk.first, chunk.last)
    drawn = to_draw(request)
    return Task(
        chunk=chunk.number,
        policy=chunk.policy,
        flights=[request.flight(k) for k in numbers],
        first=chunk.first,
        drawn=[k in drawn for k in numbers],
        together=together,
    )


def to_draw(request: Request) -> range:
    """Which flights of each policy are drawn: through the first fields, with the first seed."""
    return range(0, min(PANELS, len(request.fields)) * len(request.seeds), len(request.seeds))


def alone(task: Task) -> list[Task]:
    """Tasks of a single flight each, which together are a task."""
    return [
        Task(
            chunk=task.chunk,
            policy=task.policy,
            flights=[flight],
            first=task.first + k,
            drawn=[task.drawn[k]],
            together=task.together,
        )
        for k, flight in enumerate(task.flights)
    ]


def fly_task(task: Task) -> Answer:
    """Fly a task: a function of it but for its times, wherever it is flown.

    Raises:
        ValueError: an agent that cannot be loaded here.
        KeyboardInterrupt: after a flight, if Ctrl-C was deferred.
    """
    with _ONE_AT_A_TIME:
        compile_kernels()
        flown = _batch(task) if is_batched(task.policy) else _one_by_one(task)
        return Answer(
            chunk=task.chunk,
            flown=records.pack(flown),
            versions=provenance.versions(),
            models=list(provenance.models(task.policy).values()),
        )


def _one_by_one(task: Task) -> list[tuple[Record, Trace]]:
    flown = []
    for (source, seed), drawn in zip(task.flights, task.drawn, strict=True):
        field = field_of(source)
        try:
            flight = fly(task.policy, field, seed)
        except Exception as error:
            error.add_note(f"while {task.policy} flew the field {field.name}, seed {seed}")
            raise
        flown.append((record_of(flight), trace_of(flight, drawn)))
        raise_if_interrupted()
    return flown


def _batch(task: Task) -> list[tuple[Record, Trace]]:
    from agents.flights.batched import BATCH, fly_batch
    from agents.models.shipped_agents import find_agent
    from agents.policies.network_policy import network_policy

    place = find_agent(PolicySpec.parse(task.policy).agent)
    if place is None:
        raise ValueError(f"there is no agent {task.policy!r} where it was to fly")
    model = network_policy(place).model
    fly_batch(model, [small_field()])  # compiles what the first batch needs, outside the timing
    fields = [field_of(source) for source, _ in task.flights]
    flights = fly_batch(model, fields, task.together or BATCH, name=task.policy)
    return [
        (record_of(replace(flight, seed=seed)), trace_of(flight, drawn))
        for flight, (_, seed), drawn in zip(flights, task.flights, task.drawn, strict=True)
    ]
