"""The work directory of an evaluation: finished chunks, each a file that was written whole.

Whoever flies which chunk, and however often the work is interrupted, the chunks are the same in
the end but for their times.
"""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from agents.evaluation import records
from agents.evaluation.chunks import Answer, Task, alone, fly_task, task_of
from agents.evaluation.records import Pack, Record, Trace
from agents.evaluation.request import Chunk, Request, name_of
from agents.runtime.executors import Backend, Call, Run, WorkerDiedError, open_backend
from agents.runtime.safe_npz import read_arrays
from ferguson_gym.runtime.atomic_files import atomic_write

WORK = ".unfinished"
"""Name of the work directory in a directory of results."""
DEATHS = 3
"""Of workers that held a chunk, or a flight, before it is taken to be the cause."""
_REQUEST = "request.json"
_TOLD = 120
"""Characters of a value in a message."""


@dataclass(frozen=True, slots=True)
class Work:
    """A request's work directory in a directory of results."""

    results: Path
    request: Request

    @property
    def place(self) -> Path:
        """The work directory."""
        return self.results / WORK

    @property
    def staging(self) -> Path:
        """Where results are written before they are moved into their place."""
        return self.place / "results"

    def file(self, chunk: int) -> Path:
        """Where a chunk is kept."""
        return self.place / f"chunk-{self.request.digest}-{chunk:07d}.npz"

    def begin(self) -> list[Chunk]:
        """Make or take up the directory; returns the chunks that are missing."""
        self.place.mkdir(parents=True, exist_ok=True)
        if not (self.place / _REQUEST).exists():
            with atomic_write(self.place / _REQUEST) as temporary:
                temporary.write_text(json.dumps(self.request.configuration), encoding="utf-8")
        return [chunk for chunk in self.request.chunks if not self.file(chunk.number).exists()]

    def keep(self, chunk: int, flown: Pack) -> None:
        """Keep a finished chunk."""
        with atomic_write(self.file(chunk)) as temporary:
            np.savez(temporary, allow_pickle=False, **flown)

    def kept(self, chunk: Chunk) -> Pack:
        """What a chunk holds.

        Raises:
            OSError: it cannot be read.
        """
        path = self.file(chunk.number)
        try:
            packed = read_arrays(path)
            records.check(packed, len(chunk))
        except ValueError as error:
            raise OSError(f"{path} is damaged ({error}): remove it, and run again") from None
        return packed

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

    def remove(self) -> None:
        """Remove the directory: at once, then what was in it."""
        gone = self.place.with_name(f"{WORK}-gone")
        shutil.rmtree(gone, ignore_errors=True)
        if self.place.exists():
            self.place.rename(gone)  # half a directory would be taken for unfinished work
            shutil.rmtree(gone)


def check(work: Work) -> bool:
    """Refuse a directory that holds the work, or the results, of another configuration.

    Returns:
        Whether the results are there already.

    Raises:
        ValueError: it does.
    """
    wanted = work.request.configuration
    # a run may have been stopped before it wrote what it is
    if any(not path.name.startswith(".") for path in work.place.glob("*")):
        found = read(work.place / _REQUEST)
        _compare(found, wanted, f"an interrupted evaluation lies in {work.results}")
        return False
    if not (work.results / "flights.csv").exists():
        return False
    made = read(work.results / "summary.json").get("configuration")
    _compare(made, wanted, f"{work.results} holds results")
    return True


def read(path: Path) -> dict[str, Any]:
    """A JSON object in a file; empty where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _compare(found: object, wanted: dict[str, Any], what: str) -> None:
    way_out = "choose another --out, or start over with --fresh"
    if not isinstance(found, dict) or not found:
        raise ValueError(f"{what} that do not say how they were made; {way_out}")
    changes = [
        f"{key} was {_told(found.get(key))}, now {_told(value)}"
        for key, value in wanted.items()
        if found.get(key) != value
    ]
    if changes:
        raise ValueError(f"{what} of another configuration ({'; '.join(changes)}); {way_out}")


def _told(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= _TOLD else f"{text[:_TOLD]}..."


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
                    work.keep(answer.chunk, answer.flown)
                    held.discard(answer.chunk)
                    yield len(left.pop(answer.chunk).flights)
            except WorkerDiedError:
                blame.update(held)
                continue
            yield from _suspects(work, left, run)


def _suspects(work: Work, left: dict[int, Task], run: Run) -> Iterator[int]:
    """Fly what is left flight by flight; what does not fly is told at the end."""
    fatal: list[ChildProcessError] = []
    for number in list(left):
        task = left.pop(number)
        try:
            answers = [_alone(run, one) for one in alone(task)]
        except ChildProcessError as error:
            fatal.append(error)
            continue
        _see(work.request, answers[0])
        work.keep(number, records.join([answer.flown for answer in answers]))
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
