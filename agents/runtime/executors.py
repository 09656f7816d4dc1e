"""Who flies: this process, worker processes on this machine, or a cluster's; all through joblib."""

from __future__ import annotations

import importlib.util
import logging
import os
import queue
import re
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

from joblib import Parallel, delayed, parallel_config

from agents.evaluation.chunks import Answer, Task, end_with, fly_task
from agents.runtime.interrupts import defer_interrupt, shield_new_processes
from ferguson_gym.runtime.optional_dependencies import installing

PROCESSES, DASK, RAY = "processes", "dask", "ray"
BACKENDS = (PROCESSES, DASK, RAY)
PATIENCE = 5.0
"""How long a scheduler may take to answer [s]."""
_INSTALL = {
    DASK: ("distributed", installing("cluster")),
    RAY: ("ray", ".venv/bin/pip install ray"),
}


class WorkerDiedError(Exception):
    """A worker ended with a task in its hands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Backend:
    """Who flies.

    Raises:
        ValueError: arguments that do not go together, or a library that is not installed.
    """

    name: str = PROCESSES
    workers: int | None = None
    """Processes on this machine; None: one, this. Clusters have their own."""
    address: str | None = None
    """HOST:PORT of a cluster's scheduler."""

    def __post_init__(self) -> None:
        if self.name not in BACKENDS:
            raise ValueError(f"unknown backend {self.name!r}; backends are {', '.join(BACKENDS)}")
        if self.name == PROCESSES:
            if self.address is not None:
                raise ValueError(
                    f"--address {self.address} is for a cluster: add --backend dask or ray"
                )
            return
        if self.workers is not None:
            raise ValueError(
                f"--workers {self.workers} is for processes on this machine; with --backend "
                f"{self.name} the cluster's own workers fly, so leave it out"
            )
        if self.address is None and self.name == DASK:
            raise ValueError("--backend dask needs the --address HOST:PORT of its scheduler")
        if self.address is not None:
            place_of(self.address)
        module, hint = _INSTALL[self.name]
        if importlib.util.find_spec(module) is None:
            raise ValueError(f"--backend {self.name} needs {module}: {hint}")

    @property
    def alone(self) -> bool:
        """Whether everything happens in this process."""
        return self.name == PROCESSES and (self.workers or 1) == 1


def place_of(address: str) -> tuple[str, int]:
    """Host and port.

    Raises:
        ValueError: it is not HOST:PORT.
    """
    match = re.fullmatch(r"(?:tcp://)?\[?([^\[\]/]+?)\]?:([0-9]{1,5})", address)
    if match is None or not 0 < int(match[2]) < 65536:
        raise ValueError(f"an address is HOST:PORT, for example 10.0.0.1:8786, got {address!r}")
    return match[1], int(match[2])


def check(backend: Backend) -> None:
    """See that the scheduler answers, before any work starts.

    Raises:
        ConnectionError: it does not, or it has no workers.
    """
    if backend.address is None:
        return
    try:
        with socket.create_connection(place_of(backend.address), timeout=PATIENCE) as speaking:
            if backend.name == DASK:
                _hear_dask(speaking)
    except OSError as error:
        raise ConnectionError(_unreachable(backend, error)) from None
    if backend.name == DASK:
        with _dask(backend):
            pass


def _hear_dask(speaking: socket.socket) -> None:
    """See that it is a scheduler which listens: Dask's client waits for ever for one that is none.

    Raises:
        OSError: it is none.
    """
    speaking.settimeout(PATIENCE)
    # a scheduler speaks first, and begins with a small number
    heard = speaking.recv(8)
    if len(heard) < 8 or int.from_bytes(heard, "little") >= 2**32:
        raise OSError("something else listens there")


def _unreachable(backend: Backend, error: object) -> str:
    return (
        f"no {backend.name} scheduler at {backend.address} ({error}); start one, or correct "
        "--address"
    )


@contextmanager
def flying(backend: Backend) -> Iterator[Callable[..., Iterator[Answer]]]:
    """What flies tasks: `run(tasks, ahead)` yields answers as they come.

    `tasks` is read as workers get free; `ahead` tasks are handed out at a time (None: some more
    than there are workers). If a worker died, `run` raises `WorkerDiedError` and may be called
    again; if the scheduler is lost, OSError.
    """
    if backend.name == PROCESSES:
        yield lambda tasks, ahead=None: _processes(backend.workers or 1, tasks, ahead)
    elif backend.name == DASK:
        with _dask(backend) as client:
            yield lambda tasks, ahead=None: _on_dask(backend, client, tasks, ahead)
    else:
        with _ray(backend):
            yield _on_ray


def _processes(workers: int, tasks: Iterable[Task], ahead: int | None) -> Iterator[Answer]:
    if workers == 1:
        for task in tasks:
            with defer_interrupt():
                answer = fly_task(task)
            yield answer
        return
    parallel = Parallel(
        n_jobs=workers,
        backend="loky",
        return_as="generator_unordered",
        batch_size=1,
        pre_dispatch=ahead or 2 * workers,
        max_nbytes=None,  # no files beside the processes
    )
    with shield_new_processes():
        answers = parallel(delayed(_fly_here)(task, os.getpid()) for task in tasks)
    try:
        yield from answers
    except BrokenProcessPool:
        raise WorkerDiedError from None
    finally:
        answers.close()


_watched = threading.Event()
"""Set in worker processes that end with their parent."""


def _fly_here(task: Task, parent: int) -> Answer:
    if not _watched.is_set():
        _watched.set()
        end_with(parent)
    return fly_task(task)


@contextmanager
def _dask(backend: Backend) -> Iterator[Any]:
    """A client of the scheduler.

    Raises:
        ConnectionError: it does not answer, or has no workers.
    """
    distributed: Any = importlib.import_module("distributed")
    assert backend.address is not None
    host, port = place_of(backend.address)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what is lost is told below
    try:
        client = distributed.Client(
            f"tcp://{f'[{host}]' if ':' in host else host}:{port}",
            timeout=PATIENCE,
            set_as_default=False,
        )
    except OSError as error:
        raise ConnectionError(_unreachable(backend, error)) from None
    try:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ConnectionError(
                f"the dask scheduler at {backend.address} has no workers; start some, for example: "
                f"dask worker {backend.address} --nthreads 1"
            ) from None
        yield client
    finally:
        client.close(timeout=PATIENCE)


def _on_dask(
    backend: Backend, client: Any, tasks: Iterable[Task], ahead: int | None
) -> Iterator[Answer]:
    with parallel_config(backend="dask", client=client):
        parallel = Parallel(
            n_jobs=-1,
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch=ahead or "2*n_jobs",
        )

        def pulse() -> None:
            """Joblib waits for ever for what failed on its way."""
            if client.status != "running":
                raise OSError(
                    f"lost the dask scheduler at {backend.address}; the same command goes on where "
                    "this one stopped"
                )
            for future in [*client.futures.values()]:
                if future.status == "error":
                    raise _what_failed(backend, future.exception)

        yield from _watched_over(parallel, (delayed(fly_task)(task) for task in tasks), pulse)


def _what_failed(backend: Backend, error: BaseException | None) -> Exception:
    """Why a task came to no end: its worker died, or could not even begin."""
    if type(error).__name__ == "KilledWorker":
        return WorkerDiedError()
    return OSError(
        f"a worker of {backend.address} could not take its task ({type(error).__name__}: {error}); "
        "is the same version of this package installed there?"
    )


def _watched_over(
    parallel: Any, tasks: Iterable[Any], pulse: Callable[[], None]
) -> Iterator[Answer]:
    """The answers that a thread waits for, while another looks whether they can still come."""
    answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
    over = object()
    config = parallel._backend

    def wait() -> None:
        try:
            with parallel_config(backend=config):
                for answer in parallel(tasks):
                    answers.put(answer)
            answers.put(over)
        except BaseException as error:
            answers.put(error)

    threading.Thread(target=wait, daemon=True).start()
    while True:
        try:
            answer = answers.get(timeout=1.0)
        except queue.Empty:
            pulse()
            continue
        if answer is over:
            return
        if isinstance(answer, BaseException):
            pulse()
            raise answer
        yield answer


@contextmanager
def _ray(backend: Backend) -> Iterator[None]:
    ray: Any = importlib.import_module("ray")
    importlib.import_module("ray.util.joblib").register_ray()
    logging.getLogger("ray").setLevel(logging.ERROR)
    ray.init(address=backend.address, log_to_driver=False, logging_level=logging.ERROR)
    try:
        yield
    finally:
        ray.shutdown()


def _on_ray(tasks: Iterable[Task], ahead: int | None = None) -> Iterator[Answer]:
    """In rounds, for Ray's backend gives nothing back before all of a call is done."""
    ray: Any = importlib.import_module("ray")
    waiting = iter(tasks)
    size = ahead or 4 * max(1, int(ray.cluster_resources().get("CPU", 1)))
    while flown := list(islice(waiting, size)):
        try:
            yield from Parallel(n_jobs=-1, backend="ray", batch_size=1)(
                delayed(fly_task)(task) for task in flown
            )
        except ray.exceptions.RayError:
            raise WorkerDiedError from None
