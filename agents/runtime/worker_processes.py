"""Calls spread over worker processes, which hear no Ctrl-C, and whose death is told in one line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from joblib import Parallel

from agents.runtime.interrupts import defer_interrupt, shield_new_processes

GOES_ON = "what is finished is kept, and the same command goes on"
Call = tuple[Callable[..., Any], Sequence[Any], Mapping[str, Any]]
"""As `joblib.delayed` makes it."""


def map_in_processes(
    calls: Iterable[Call], workers: int, *, in_order: bool, afterwards: str
) -> Iterator[Any]:
    """Results of calls as they come, by so many processes; a single one is this.

    Args:
        calls: what to do; read as workers get free.
        workers: number of processes.
        in_order: whether results come in the order of their calls.
        afterwards: what is left when a worker dies, and how to go on.

    Raises:
        ChildProcessError: a worker died.
        KeyboardInterrupt: between two calls, if this is the only process.
    """
    if workers == 1:
        for function, given, named in calls:
            with defer_interrupt():
                result = function(*given, **named)
            yield result
        return
    parallel = Parallel(
        n_jobs=workers, return_as="generator" if in_order else "generator_unordered"
    )
    with shield_new_processes():
        results = parallel(calls)
    try:
        with deaths_told(afterwards):
            yield from results
    finally:
        results.close()


@contextmanager
def deaths_told(afterwards: str = GOES_ON) -> Iterator[None]:
    """Say in one line that a worker process died, and what is left afterwards."""
    try:
        yield
    except BrokenProcessPool:
        raise ChildProcessError(
            "a worker process died: killed, or short of memory, of which fewer --workers take "
            f"less; {afterwards}"
        ) from None
