"""The work of an evaluation: flying its chunks, in any order and by any worker."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from joblib import delayed
from numpy.typing import NDArray

from agents.evaluation.chunks import Result, Task, fly_task, single_flights, task_of
from agents.evaluation.request import Chunk, Request, name_of
from agents.flights import Flight
from agents.flights.flight_table import PATHS, Columns, FlightTable, check, drawable, join
from agents.runtime.chunk_store import ChunkStore, read_json, refuse_other
from agents.runtime.executors import Backend, Run, open_backend
from agents.runtime.worker_processes import WorkerDiedError
from ferguson_gym.runtime.arrays import Array

WORK = ".unfinished"
"""Name of the work directory in a directory of results."""


@dataclass(frozen=True)
class Work:
    """A request's unfinished work in a directory of results."""

    results: Path
    request: Request

    @cached_property
    def store(self) -> ChunkStore:
        """The finished chunks."""
        return ChunkStore(
            place=self.results / WORK,
            request=self.request.configuration,
            number=len(self.request.chunks),
            digits=7,
        )

    @property
    def staging(self) -> Path:
        """Where results are written before they are moved to the directory of results."""
        return self.store.place / "results"

    def begin(self) -> list[Chunk]:
        """Make or resume the work directory; returns the chunks that are missing."""
        return [self.request.chunks[number] for number in self.store.begin()]

    def columns(self, chunk: Chunk) -> Columns:
        """The flights of a finished chunk.

        Raises:
            OSError: The chunk cannot be read.
        """
        return self.store.read(chunk.number, partial(check, number=len(chunk)))

    def table(self) -> FlightTable:
        """All flights, without their paths, when no chunk is missing.

        Raises:
            OSError: A chunk cannot be read.
        """
        request, number = self.request, np.arange(self.request.flights)
        policy, index = np.divmod(number, request.each)
        field, seed = np.divmod(index, len(request.seeds))
        parts = [self.columns(chunk) for chunk in request.chunks]
        scalars = [{k: v for k, v in part.items() if k not in PATHS} for part in parts]
        return FlightTable(
            policies=tuple(request.policies),
            fields=tuple(map(name_of, request.fields)),
            seeds=tuple(request.seeds),
            policy=policy,
            field=field,
            seed=seed,
            columns=join(scalars),
        )

    def drawn(self, policy: str, indices: Iterable[int]) -> list[Flight]:
        """Flights of a policy for its picture; indices are among the policy's flights."""
        wanted = set(indices)
        flights = []
        for chunk in self.request.chunks:
            here = sorted(wanted & set(range(chunk.first, chunk.last)))
            if chunk.policy != policy or not here:
                continue
            columns = self.columns(chunk)
            for index in here:
                source, seed = self.request.flight(index)
                place = index - chunk.first
                flights.append(drawable(columns, place, policy, self.request.field(source), seed))
        return flights


@dataclass(frozen=True)
class FlownPaths:
    """The paths of all flights, in chunks (`agents.evaluation.results.Paths`)."""

    work: Work
    segments: NDArray[np.int64]

    def control(self, flights: Iterable[int]) -> dict[int, Array]:
        """Segments (m, 4, 2) of some flights, whose indices ascend."""
        wanted = np.fromiter(flights, np.int64)
        found: dict[int, Array] = {}
        first = 0
        for chunk in self.work.request.chunks:
            last = first + len(chunk)
            here = wanted[(wanted >= first) & (wanted < last)]
            if len(here):
                control = self.work.columns(chunk)["control"]
                parts = np.split(control, np.cumsum(self.segments[first:last])[:-1])
                found |= {k: parts[k - first] for k in here.tolist()}
            first = last
        return found


def is_finished(work: Work) -> bool:
    """Whether the directory holds the results of this request.

    Raises:
        ValueError: It holds the work, or the results, of another configuration.
    """
    if work.store.holds_work() or not (work.results / "flights.csv").exists():
        return False
    made = read_json(work.results / "summary.json").get("configuration")
    refuse_other(made, work.request.configuration, f"the evaluation at {work.results}")
    return True


def fly(
    work: Work, missing: Iterable[Chunk], backend: Backend, batch: int | None = None
) -> Iterator[int]:
    """Fly and store the missing chunks; yields the number of flights of each finished chunk.

    When a worker dies, another one flies its chunks again. Chunks of which one ended its workers
    every time are flown flight by flight, after all others, to find the flight that is the cause.

    Raises:
        ChildProcessError: One flight ends its worker every time.
        OSError: The connection to the scheduler was lost, or a file cannot be written.
    """
    left = {chunk.number: task_of(work.request, chunk, batch) for chunk in missing}
    suspects: set[int] = set()
    with open_backend(backend) as run:
        while left:
            rest = [task for number, task in left.items() if number not in suspects]
            try:
                for result in run(delayed(fly_task)(task) for task in rest):
                    _check_software(work.request, result)
                    work.store.write(result.chunk, result.columns)
                    yield len(left.pop(result.chunk).flights)
            except WorkerDiedError as error:
                suspects.update(task.chunk for _, (task,), _ in error.calls)
                continue
            yield from _suspects(work, left, run)


def _suspects(work: Work, left: dict[int, Task], run: Run) -> Iterator[int]:
    """Fly the remaining tasks flight by flight; raises for the fatal ones at the end."""
    fatal: list[ChildProcessError] = []
    for number in list(left):
        task = left.pop(number)
        try:
            results = [_run_alone(run, one) for one in single_flights(task)]
        except ChildProcessError as error:
            fatal.append(error)
            continue
        _check_software(work.request, results[0])
        work.store.write(number, join([result.columns for result in results]))
        yield len(task.flights)
    if fatal:
        raise fatal[0]


def _run_alone(run: Run, task: Task) -> Result:
    """The result of a task of one flight, with no other task in flight."""
    try:
        (result,) = run([delayed(fly_task)(task)], 1)
    except WorkerDiedError:
        (source, seed) = task.flights[0]
        raise ChildProcessError(
            f"workers died every time that {task.policy} flew the field {name_of(source)}, seed "
            f"{seed}: too little memory, or a crash in a library; finished chunks are kept"
        ) from None
    found: Result = result
    return found


def _check_software(request: Request, result: Result) -> None:
    """Refuse what was flown with other libraries, or other models."""
    own = request.software["versions"]
    names = [name for name in own if result.versions.get(name) != own[name]]
    if names:
        other = ", ".join(f"{name} {result.versions.get(name)}, not {own[name]}" for name in names)
        raise OSError(f"a worker has other versions, which may change flights: {other}")
    policy = request.chunks[result.chunk].policy
    if result.models != list(request.configuration["policies"][policy].values()):
        raise OSError(f"the model of {policy} differs on a worker, or has changed since the start")
