"""Calls spread over worker processes of this machine; what dead workers leave is run again."""

from __future__ import annotations

import itertools
import logging
import os
import re
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from joblib import Parallel, delayed

from agents.runtime import registrations
from agents.runtime.interrupts import defer_interrupt, shield_new_processes
from agents.runtime.registrations import Registrations
from agents.runtime.safe_npz import reason
from ferguson_gym.runtime.compilation import PACKAGE

DEATHS = 3
"""Deaths of workers, without a result between them, after which their calls are given up."""
RESUMES = "what is finished is kept, and the same command resumes"
Call = tuple[Callable[..., Any], Sequence[Any], Mapping[str, Any]]
"""A function with its arguments, as `joblib.delayed` returns it."""


class WorkerDiedError(ChildProcessError):
    """Workers ended before they finished a call, every time that it was tried."""

    def __init__(self, message: str, calls: Iterable[Call]) -> None:
        super().__init__(message)
        self.calls = tuple(calls)
        """Unfinished calls, among them the one whose workers died."""


@contextmanager
def map_in_processes(
    calls: Iterable[Call],
    workers: int,
    *,
    in_order: bool = False,
    ahead: int | None = None,
    afterwards: str = RESUMES,
) -> Iterator[Iterator[Any]]:
    """Spread calls over worker processes, which start immediately and know this one's planners.

    Workers ignore Ctrl-C and end with this process. If a worker dies, new workers run all calls
    again whose results have not been read, and a warning is issued; a call may therefore run more
    than once. Calls that are unfinished at the end of the block are cancelled.

    Args:
        calls: the calls; the next one is read when a worker is free.
        workers: number of processes. With 1, calls run in this process as results are read.
        in_order: whether results keep the order of their calls.
        ahead: number of calls handed out at a time; None: two for each worker.
        afterwards: end of the message of `WorkerDiedError`: what is kept and how to resume.

    Yields:
        An iterator over the results.

    Raises:
        WorkerDiedError: Workers died `DEATHS` times, and no result was read between.
        OSError: A planner registered here cannot be sent to a worker.
        KeyboardInterrupt: Ctrl-C was pressed; between two calls if `workers` is 1.
    """
    if workers == 1:
        yield _one_by_one(calls)
        return
    pool = _WorkerPool(calls, workers, in_order, ahead or 2 * workers, afterwards)
    try:
        pool.start()
        yield pool
    finally:
        pool.close()


def _one_by_one(calls: Iterable[Call]) -> Iterator[Any]:
    for function, given, named in calls:
        with defer_interrupt():
            result = function(*given, **named)
        yield result


class _WorkerPool(Iterator[Any]):
    """The results of calls in worker processes that are replaced when one of them dies.

    The library starts a new pool after a death, but it drops the calls that were handed out and
    does not say which of them were running. The pool therefore keeps them until their results are
    read, and counts deaths without a result between them: the earliest calls were running each
    time.
    """

    def __init__(
        self, calls: Iterable[Call], workers: int, in_order: bool, ahead: int, afterwards: str
    ) -> None:
        self._waiting = enumerate(calls)
        self._workers, self._in_order, self._ahead = workers, in_order, ahead
        self._afterwards = afterwards
        self._sent = os.getpid(), registrations.sendable()
        self._held: dict[int, Call] = {}
        """Calls that were handed out and whose results were not read, by their number."""
        self._lock = threading.Lock()
        self._generation = 0
        self._deaths = self._in_a_row = 0
        self._results: Any = None

    def start(self) -> None:
        """Start workers, and hand out the calls that earlier workers left before any others."""
        while True:
            with self._lock:
                self._generation += 1
                calls = self._calls(self._generation, sorted(self._held.items()))
            parallel = Parallel(
                n_jobs=self._workers,
                backend="loky",
                return_as="generator" if self._in_order else "generator_unordered",
                # a finished result does not wait for others
                batch_size="auto" if self._in_order else 1,
                pre_dispatch=self._ahead,
                max_nbytes=None,  # arguments travel through pipes, not through files
            )
            try:
                with shield_new_processes():
                    self._results = parallel(calls)
            except BrokenProcessPool as error:
                self._count_death(error)
                continue
            return

    def __next__(self) -> Any:
        while True:
            try:
                number, result = next(self._results)
            except BrokenProcessPool as error:
                self._count_death(error)
                self.start()
                continue
            del self._held[number]
            self._in_a_row = 0
            return result

    def close(self) -> None:
        """Cancel the calls that are unfinished."""
        if self._results is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # joblib warns of cancelled calls
                self._results.close()

    def _calls(self, generation: int, again: list[tuple[int, Call]]) -> Iterator[Call]:
        """Calls for one generation of workers; threads of joblib read them."""
        waiting = itertools.chain(again, self._waiting)
        while True:
            with self._lock:
                # a thread of the generation before may still ask: it must not take a call
                if generation != self._generation or (found := next(waiting, None)) is None:
                    return
                number, call = found
                self._held[number] = call
            yield delayed(_call_in_worker)(*self._sent, number, *call)

    def _count_death(self, error: BrokenProcessPool) -> None:
        """Warn of a death; raises `WorkerDiedError` if it is the last that is tolerated."""
        self._deaths += 1
        self._in_a_row += 1
        codes = re.search(r"exit codes of the workers are \{(.+?)\}", str(error))
        cause = codes[1] if codes else reason(error)
        if self._in_a_row == DEATHS:
            raise WorkerDiedError(
                f"worker processes died {DEATHS} times in a row at the same work ({cause}): short "
                "of memory, or a crash in a library; give fewer --workers, or free memory; "
                f"{self._afterwards}",
                self._held.values(),
            ) from None
        warnings.warn(
            f"a worker process died ({cause}): killed, short of memory, or a crash in a library; "
            # the number makes texts differ: Python shows equal warnings once
            f"new workers repeat what it left unfinished (death {self._deaths}; {DEATHS} in a row "
            "without a result are an error)",
            RuntimeWarning,
            stacklevel=2,
        )


_watched = threading.Event()
"""Set in a worker process once the thread runs that ends it with its parent."""


def _call_in_worker(
    parent: int,
    planners: Registrations,
    number: int,
    function: Callable[..., Any],
    given: Sequence[Any],
    named: Mapping[str, Any],
) -> tuple[int, Any]:
    """Run a call in a worker process; returns its number and its result."""
    if not _watched.is_set():
        _watched.set()
        logging.getLogger(PACKAGE).setLevel(logging.ERROR)  # the first process announces it
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    registrations.adopt(planners)
    return number, function(*given, **named)


def _end_with(parent: int) -> None:
    """End this process when its parent has ended, also if the parent was killed."""
    if os.name != "posix":  # elsewhere a process keeps its parent's number
        return
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
