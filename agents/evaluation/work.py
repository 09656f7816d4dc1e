"""The work of an evaluation: chunks of flights, the same in the end but for their times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path

from joblib import delayed

from agents.evaluation import records
from agents.evaluation.chunks import Answer, Task, alone, fly_task, task_of
from agents.evaluation.records import Pack, Record, Trace
from agents.evaluation.request import Chunk, Request, name_of
from agents.runtime.chunk_store import ChunkStore, read_json, refuse_other
from agents.runtime.executors import Backend, Call, Run, WorkerDiedError, open_backend

WORK = ".unfinished"
"""Name of the work directory in a directory of results."""
DEATHS = 3
"""Of workers that held a chunk, or a flight, before it is taken to be the cause."""


@dataclass(frozen=True)
class Work:
    """A request's unfinished work in a directory of results."""

    results: Path
    request: Request

    @cached_property
    def store(self) -> ChunkStore:
        """The work directory."""
        return ChunkStore(
            place=self.results / WORK,
            request=self.request.configuration,
            number=len(self.request.chunks),
            digits=7,
        )

    @property
    def staging(self) -> Path:
        """Where results are written before they are moved into their place."""
        return self.store.place / "results"

    def begin(self) -> list[Chunk]:
        """Make or resume the directory; returns the chunks that are missing."""
        return [self.request.chunks[number] for number in self.store.begin()]

    def kept(self, chunk: Chunk) -> Pack:
        """What a chunk holds.

        Raises:
            OSError: it cannot be read.
        """

        def parse(packed: Pack) -> Pack:
            records.check(packed, len(chunk))
            return packed

        return self.store.read(chunk.number, parse)

    def records(self, policy: str | None = None) -> Iterator[Record]:
        """The records of all flights, or of a policy's, in order; when no chunk is missing."""
        for chunk in self.request.chunks:
            if policy in (None, chunk.policy):
                yield from records.records(self.kept(chunk), self.request.keys(chunk))

    def trace(self, chunk: Chunk, index: int) -> tuple[Record, Trace]:
        """A flight of a chunk, its path too; `index` is among those of the policy."""
        place = index - chunk.first
        packed = self.kept(chunk)
        rows = records.records(packed, self.request.keys(chunk))
        return next(islice(rows, place, None)), next(islice(records.traces(packed), place, None))


def check(work: Work) -> bool:
    """Refuse a directory that holds the work, or the results, of another configuration.

    Returns:
        Whether the results are there already.

    Raises:
        ValueError: it does.
    """
    if work.store.holds_work():
        return False
    if not (work.results / "flights.csv").exists():
        return False
    made = read_json(work.results / "summary.json").get("configuration")
    refuse_other(made, work.request.configuration, f"the evaluation at {work.results}")
    return True


def fly(
    work: Work, missing: Iterable[Chunk], backend: Backend, together: int | None = None
) -> Iterator[int]:
    """Fly and keep the missing chunks; yields the number of flights of each that is done.

    When a worker dies, what it held is flown again by another. A chunk that was there each time is
    flown flight by flight, after all others, to find the one which it is.

    Raises:
        ChildProcessError: one flight always ends its worker.
        OSError: the scheduler was lost, or the disk refuses.
    """
    left = {chunk.number: task_of(work.request, chunk, together) for chunk in missing}
    blame: Counter[int] = Counter()
    with open_backend(backend) as run:
        while left:
            held: set[int] = set()
            rest = [task for number, task in left.items() if blame[number] < DEATHS]
            try:
                for answer in run(_calls(rest, held)):
                    _see(work.request, answer)
                    work.store.write(answer.chunk, answer.flown)
                    held.discard(answer.chunk)
                    yield len(left.pop(answer.chunk).flights)
            except WorkerDiedError:
                blame.update(held)
                continue
            yield from _suspects(work, left, run)


def _suspects(work: Work, left: dict[int, Task], run: Run) -> Iterator[int]:
    """Fly what is left flight by flight; what does not fly is reported at the end."""
    fatal: list[ChildProcessError] = []
    for number in list(left):
        task = left.pop(number)
        try:
            answers = [_alone(run, one) for one in alone(task)]
        except ChildProcessError as error:
            fatal.append(error)
            continue
        _see(work.request, answers[0])
        work.store.write(number, records.join([answer.flown for answer in answers]))
        yield len(task.flights)
    if fatal:
        raise fatal[0]


def _calls(tasks: Iterable[Task], held: set[int]) -> Iterator[Call]:
    """Calls that fly tasks, whose chunks are added to `held` as they are handed out."""
    for task in tasks:
        held.add(task.chunk)
        yield delayed(fly_task)(task)


def _alone(run: Run, task: Task) -> Answer:
    """The answer to a task of one flight, with no other in the air."""
    for _ in range(DEATHS):
        try:
            (answer,) = run(_calls([task], set()), 1)
        except WorkerDiedError:
            continue
        found: Answer = answer
        return found
    (source, seed) = task.flights[0]
    raise ChildProcessError(
        f"a worker died {DEATHS} times while {task.policy} flew the field {name_of(source)}, seed "
        f"{seed}: too little memory, or a crash in a library; what is finished is kept"
    )


def _see(request: Request, answer: Answer) -> None:
    """Refuse what was flown with other libraries, or other models."""
    own = request.software["versions"]
    other = [name for name in own if answer.versions.get(name) != own[name]]
    if other:
        told = ", ".join(f"{name} {answer.versions.get(name)}, not {own[name]}" for name in other)
        raise OSError(f"a worker has other versions, and may fly otherwise: {told}")
    policy = request.chunks[answer.chunk].policy
    if answer.models != list(request.configuration["policies"][policy].values()):
        raise OSError(f"the model of {policy} is not the same for a worker, or was changed")
