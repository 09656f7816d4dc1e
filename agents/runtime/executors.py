"""Backends of an evaluation: worker processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import re
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

from agents.runtime import registrations
from agents.runtime.registrations import Registrations
from agents.runtime.safe_npz import reason
from agents.runtime.worker_processes import RESUMES, Call, WorkerDiedError, map_in_processes
from ferguson_gym.runtime.optional_dependencies import installing

PROCESSES, DASK = "processes", "dask"
BACKENDS = (PROCESSES, DASK)
TIMEOUT = 5.0
"""Time limit for an answer of the scheduler [s]."""


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
        A function that runs calls there. It raises `WorkerDiedError` if workers died with a call
        every time that it was tried, and may then be called again; it raises OSError if the
        connection to the scheduler is lost.
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

    held: dict[str, Call] = {}

    def hand_out(number: int) -> None:
        for call in islice(waiting, number):
            future = client.submit(_attempt, planners, *call, pure=False)
            held[future.key] = call
            finished.add(future)

    hand_out(ahead or 2 * max(1, sum(client.nthreads().values())))
    for future in finished:
        call = held.pop(future.key)
        try:
            result, error = future.result()
        except distributed.KilledWorker:  # the scheduler has tried several workers
            raise WorkerDiedError(f"workers of {backend.address} died; {RESUMES}", [call]) from None
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
