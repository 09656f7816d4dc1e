"""Run a library that may crash or hang in a subprocess, with a time limit for each request.

The module that runs in the subprocess calls `serve`; the program holds a `Worker`. Requests and
answers are pickles on a private pair of sockets, which the library's own output cannot disturb.
Each side notices at once when the other has ended. Unlike with pebble's process pool, `SIGALRM`
ends a hung subprocess even if the program was killed, and a round trip takes a third of the time.
POSIX only.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from planners.interface import CrashedError

ROOT = Path(__file__).parents[2]
"""Directory from which the subprocess imports modules."""
START_TIMEOUT = 120.0
"""Time limit for the start [s]; the first start on a machine compiles kernels."""


@dataclass(frozen=True, slots=True)
class Failure:
    """An answer that reports an exception."""

    reason: str


class Worker:
    """A subprocess that answers requests one at a time; the first request starts it.

    After a crash the next request starts another one. The subprocess ends with this object, with
    the program, or when the program is killed. A pickled copy, or a copy in a forked process,
    starts its own subprocess.
    """

    def __init__(self, module: str) -> None:
        """Create a worker for a module that calls `serve`, given by its dotted name."""
        self._module = module
        self._lock = threading.Lock()
        self._subprocess: _Subprocess | None = None

    def __reduce__(self) -> tuple[type[Worker], tuple[str]]:
        return Worker, (self._module,)

    @property
    def pid(self) -> int | None:
        """Process id of the subprocess; None if it does not run."""
        return None if self._subprocess is None else self._subprocess.process.pid

    def ask(self, request: object, timeout: float) -> Any:
        """Send a request, anything that can be pickled, and wait for the answer.

        The timeout [s] does not include the start of the subprocess.

        Raises:
            CrashedError: The request raised an exception, or the subprocess ended or did not
                answer in time; in the last two cases it has been killed.
        """
        with self._lock:
            try:
                running = self._started()
                running.send((request, timeout))
                answer = running.receive(timeout)
            except BaseException:  # a late answer must not be taken for the next one
                self._end()
                raise
        if isinstance(answer, Failure):
            raise CrashedError(f"{self._module} failed: {answer.reason}")
        return answer

    def _started(self) -> _Subprocess:
        if self._subprocess is None or not self._subprocess.usable:
            self._end()
            self._subprocess = _Subprocess(self._module)
            weakref.finalize(self, self._subprocess.end)
            self._subprocess.receive(START_TIMEOUT)  # the message "ready"
        return self._subprocess

    def _end(self) -> None:
        if self._subprocess is not None:
            self._subprocess.end()
            self._subprocess = None


@cache
def shared_worker(module: str) -> Worker:
    """The worker for a module that all routers share, because its start takes a second."""
    return Worker(module)


class _Subprocess:
    """A running subprocess and the connection to it."""

    def __init__(self, module: str) -> None:
        self.module = module
        self.owner = os.getpid()
        self.connection, theirs = Pipe()
        path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, str(theirs.fileno())],
                env={**os.environ, "PYTHONPATH": path},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )

    @property
    def usable(self) -> bool:
        return self.owner == os.getpid() and self.process.poll() is None

    def send(self, request: object) -> None:
        try:
            self.connection.send(request)
        except OSError:
            raise self._ended() from None

    def receive(self, timeout: float) -> Any:
        try:
            if self.connection.poll(timeout):
                return self.connection.recv()
        except (EOFError, OSError):
            raise self._ended() from None
        raise CrashedError(f"{self.module} did not answer within {timeout:g} s")

    def _ended(self) -> CrashedError:
        return CrashedError(f"{self.module} ended with exit status {self.process.wait()}")

    def end(self) -> None:
        if self.owner == os.getpid():
            self.connection.close()
            self.process.kill()
            self.process.wait()


def serve(answer: Callable[[Any], object]) -> None:
    """Answer the requests of the `Worker` that started this process, until that ends."""
    # on Ctrl-C the program ends its workers itself
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    connection.send("ready")
    try:
        while True:
            request, timeout = connection.recv()
            # SIGALRM ends this process if it hangs after the program was killed
            signal.alarm(math.ceil(timeout) + 1)
            try:
                reply = answer(request)
            except Exception as error:
                reply = Failure(f"{type(error).__name__}: {error}")
            signal.alarm(0)
            connection.send(reply)
    except (EOFError, OSError):
        os._exit(0)  # without the clean-up of libraries
