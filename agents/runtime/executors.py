"""Work spread over worker processes of this machine, or over the workers of a Dask cluster."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import re
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

from joblib import Parallel, delayed

from agents.runtime import registrations
from agents.runtime.interrupts import defer_interrupt, shield_new_processes
from agents.runtime.registrations import Registrations
from agents.runtime.safe_npz import reason
from ferguson_gym.runtime.compilation import PACKAGE
from ferguson_gym.runtime.optional_dependencies import installing

PROCESSES, DASK = "processes", "dask"
BACKENDS = (PROCESSES, DASK)
TIMEOUT = 5.0
"""Time limit for an answer of the scheduler [s]."""
RESUMES = "what is finished is kept, and the same command resumes"
Call = tuple[Callable[..., Any], Sequence[Any], Mapping[str, Any]]
"""A function with its arguments, as `joblib.delayed` returns it."""


class WorkerDiedError(ChildProcessError):
    """A worker ended before it finished its call."""


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

    Workers ignore Ctrl-C and end with this process. Calls that are unfinished at the end of the
    block are cancelled.

    Args:
        calls: the calls; the next one is read when a worker is free.
        workers: number of processes. With 1, calls run in this process as results are read.
        in_order: whether results keep the order of their calls.
        ahead: number of calls handed out at a time; None: two for each worker.
        afterwards: end of the message of `WorkerDiedError`: what is kept and how to resume.

    Yields:
        An iterator over the results.

    Raises:
        WorkerDiedError: A worker process died.
        OSError: A planner registered here cannot be sent to a worker.
        KeyboardInterrupt: Ctrl-C was pressed; between two calls if `workers` is 1.
    """
    if workers == 1:
        yield _one_by_one(calls)
        return
    parallel = Parallel(
        n_jobs=workers,
        backend="loky",
        return_as="generator" if in_order else "generator_unordered",
        batch_size="auto" if in_order else 1,  # a finished result does not wait for others
        pre_dispatch=ahead or 2 * workers,
        max_nbytes=None,  # arguments travel through pipes, not through files
    )
    sent = os.getpid(), registrations.sendable()
    with shield_new_processes():
        results = parallel(delayed(_call_in_worker)(*sent, *call) for call in calls)
    try:
        yield results
    except BrokenProcessPool:
        raise WorkerDiedError(
            "a worker process died: killed, or short of memory, of which fewer --workers take "
            f"less; {afterwards}"
        ) from None
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # joblib warns of cancelled calls
            results.close()


def _one_by_one(calls: Iterable[Call]) -> Iterator[Any]:
    for function, given, named in calls:
        with defer_interrupt():
            result = function(*given, **named)
        yield result


_watched = threading.Event()
"""Set in a worker process once the thread runs that ends it with its parent."""


def _call_in_worker(
    parent: int,
    planners: Registrations,
    function: Callable[..., Any],
    given: Sequence[Any],
    named: Mapping[str, Any],
) -> Any:
    if not _watched.is_set():
        _watched.set()
        logging.getLogger(PACKAGE).setLevel(logging.ERROR)  # the first process announces it
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    registrations.adopt(planners)
    return function(*given, **named)


def _end_with(parent: int) -> None:
    """End this process when its parent has ended, also if the parent was killed."""
    if os.name != "posix":  # elsewhere a process keeps its parent's number
        return
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Backend:
    """Where calls run: processes on this machine or the workers of a Dask cluster.

    Raises:
        ValueError: The arguments contradict each other, or a library is not installed.
    """

    name: str = PROCESSES
    workers: int | None = None
    """Number of processes on this machine; None: this process alone. A cluster has its own."""
    address: str | None = None
    """HOST:PORT of the scheduler of a cluster."""

    def __post_init__(self) -> None:
        if self.name not in BACKENDS:
            raise ValueError(f"unknown backend {self.name!r}; backends are {', '.join(BACKENDS)}")
        if self.name == PROCESSES:
            if self.address is not None:
                raise ValueError(f"--address {self.address} is for a cluster: add --backend dask")
            return
        if self.workers is not None:
            raise ValueError(
                f"--workers {self.workers} is for processes on this machine; with --backend "
                f"{self.name} the cluster's own workers fly, so leave it out"
            )
        if self.address is None:
            raise ValueError("--backend dask needs the --address HOST:PORT of its scheduler")
        parse_address(self.address)
        if importlib.util.find_spec("distributed") is None:
            raise ValueError(f"--backend dask needs distributed: {installing('cluster')}")


def parse_address(address: str) -> tuple[str, int]:
    """Split HOST:PORT into its parts; raises ValueError for any other text."""
    match = re.fullmatch(r"(?:tcp://)?\[?([^\[\]/]+?)\]?:([0-9]{1,5})", address)
    if match is None or not 0 < int(match[2]) < 65536:
        raise ValueError(f"an address is HOST:PORT, for example 10.0.0.1:8786, got {address!r}")
    return match[1], int(match[2])


def check(backend: Backend) -> None:
    """Check that the scheduler answers, before any work starts.

    Raises:
        ConnectionError: The scheduler does not answer, or it has no workers.
    """
    if backend.address is None:
        return
    try:
        with socket.create_connection(parse_address(backend.address), TIMEOUT) as connection:
            # Dask's client waits forever if something else listens there. A scheduler speaks
            # first, and begins with a small number.
            connection.settimeout(TIMEOUT)
            greeting = connection.recv(8)
            if len(greeting) < 8 or int.from_bytes(greeting, "little") >= 2**32:
                raise OSError("something else listens there")
    except OSError as error:
        raise _unreachable(backend, error) from None
    with _dask(backend):
        pass


def _unreachable(backend: Backend, error: object) -> ConnectionError:
    return ConnectionError(
        f"no dask scheduler at {backend.address} ({error}); start one, or correct --address"
    )


Run = Callable[..., Iterator[Any]]
"""`run(calls, ahead=None)` yields results in order of completion; `calls` is read as workers become
free, and `ahead` of them are handed out at a time (None: two for each worker)."""


@contextmanager
def open_backend(backend: Backend) -> Iterator[Run]:
    """Connect to a backend.

    Yields:
        A function that runs calls there. It raises `WorkerDiedError` if a worker died, and may then
        be called again; it raises OSError if the connection to the scheduler is lost.
    """
    if backend.name == DASK:
        with _dask(backend) as client:
            yield lambda calls, ahead=None: _in_cluster(backend, client, calls, ahead)
        return

    def run(calls: Iterable[Call], ahead: int | None = None) -> Iterator[Any]:
        with map_in_processes(calls, backend.workers or 1, ahead=ahead) as results:
            yield from results

    yield run


@contextmanager
def _dask(backend: Backend) -> Iterator[Any]:
    """Connect a client to the scheduler; raises ConnectionError if that fails or has no workers."""
    distributed: Any = importlib.import_module("distributed")
    assert backend.address is not None
    host, port = parse_address(backend.address)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # losses are reported below
    try:
        client = distributed.Client(
            f"tcp://{f'[{host}]' if ':' in host else host}:{port}",
            timeout=TIMEOUT,
            set_as_default=False,
        )
    except OSError as error:
        raise _unreachable(backend, error) from None
    try:
        try:
            client.wait_for_workers(1, timeout=TIMEOUT)
        except TimeoutError:
            raise ConnectionError(
                f"the dask scheduler at {backend.address} has no workers; start some, for example: "
                f"dask worker {backend.address} --nthreads 1"
            ) from None
        yield client
    finally:
        client.close(timeout=TIMEOUT)


def _in_cluster(
    backend: Backend, client: Any, calls: Iterable[Call], ahead: int | None
) -> Iterator[Any]:
    distributed: Any = importlib.import_module("distributed")
    waiting, planners = iter(calls), registrations.sendable()
    finished = distributed.as_completed(loop=client.loop)

    def hand_out(number: int) -> None:
        for call in islice(waiting, number):
            finished.add(client.submit(_attempt, planners, *call, pure=False))

    hand_out(ahead or 2 * max(1, sum(client.nthreads().values())))
    for future in finished:
        try:
            result, error = future.result()
        except distributed.KilledWorker:  # the scheduler has tried several workers
            raise WorkerDiedError(f"workers of {backend.address} died; {RESUMES}") from None
        except CancelledError:
            raise OSError(f"lost the dask scheduler at {backend.address}; {RESUMES}") from None
        except Exception as error:
            raise OSError(
                f"a worker of {backend.address} could not start a call ({type(error).__name__}: "
                f"{reason(error)}); is the same version of this package installed there?"
            ) from None
        if error is not None:
            raise error
        hand_out(1)
        yield result


def _attempt(
    planners: Registrations,
    function: Callable[..., Any],
    given: Sequence[Any],
    named: Mapping[str, Any],
) -> tuple[Any, Exception | None]:
    """The result of a call, or its error; any other error then means that it did not start."""
    try:
        registrations.adopt(planners)
        return function(*given, **named), None
    except Exception as error:
        return None, error
