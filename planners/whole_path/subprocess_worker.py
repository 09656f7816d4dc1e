"""A process of its own for libraries that can crash or hang: asked, waited for, killed.

The module that runs in it calls `serve`; whoever needs its answers holds a `Worker`. Requests and
answers travel as pickles over a private pair of sockets, so nothing that a library prints is in
the way. Either side notices at once when the other is gone. It takes a POSIX system.
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
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from planners.interface import CrashedError

ROOT = Path(__file__).parents[2]
"""Where modules are imported from."""
STARTING = 120.0
"""How long a process may take to start [s]; the first one on a machine compiles."""


@dataclass(frozen=True, slots=True)
class Failure:
    """An answer that is an error."""

    reason: str


class Worker:
    """A process that answers one request after the other; started by the first, and after a crash.

    It ends with this object, with the program, or when the program is killed. A pickled copy, and
    a copy in a forked process, has a process of its own.
    """

    def __init__(self, module: str) -> None:
        """Take the name of a module that serves."""
        self._module = module
        self._lock = threading.Lock()
        self._live: _Live | None = None

    def __reduce__(self) -> tuple[type[Worker], tuple[str]]:
        return Worker, (self._module,)

    @property
    def pid(self) -> int | None:
        """The process's number, None while there is no process."""
        return None if self._live is None else self._live.process.pid

    def ask(self, request: object, patience: float) -> Any:
        """The answer to a request.

        Args:
            request: anything that can be pickled.
            patience: how long to wait [s]; starting the process does not count.

        Raises:
            CrashedError: the process failed, ended or did not answer in time; unless it just
                failed, it is gone.
        """
        with self._lock:
            try:
                live = self._started()
                live.send((request, patience))
                answer = live.receive(patience)
            except BaseException:  # an answer that comes later must not be taken for the next
                self._end()
                raise
        if isinstance(answer, Failure):
            raise CrashedError(f"{self._module} failed: {answer.reason}")
        return answer

    def _started(self) -> _Live:
        if self._live is None or not self._live.mine:
            self._end()
            self._live = _Live(self._module)
            weakref.finalize(self, self._live.end)
            self._live.receive(STARTING)  # it is ready
        return self._live

    def _end(self) -> None:
        if self._live is not None:
            self._live.end()
            self._live = None


class _Live:
    """A running process and the way to it."""

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
    def mine(self) -> bool:
        return self.owner == os.getpid() and self.process.poll() is None

    def send(self, request: object) -> None:
        try:
            self.connection.send(request)
        except OSError:
            raise self._ended() from None

    def receive(self, patience: float) -> Any:
        try:
            if self.connection.poll(patience):
                return self.connection.recv()
        except (EOFError, OSError):
            raise self._ended() from None
        raise CrashedError(f"{self.module} did not answer within {patience:g} s")

    def _ended(self) -> CrashedError:
        return CrashedError(f"{self.module} ended with exit status {self.process.wait()}")

    def end(self) -> None:
        if self.owner == os.getpid():
            self.connection.close()
            self.process.kill()
            self.process.wait()


def serve(answer: Callable[[Any], object]) -> None:
    """Answer the requests of the `Worker` that started this process, until it is gone."""
    # whoever interrupts the program decides what becomes of its workers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    connection.send("ready")
    try:
        while True:
            request, patience = connection.recv()
            # the kernel ends what hangs after the program was killed
            signal.alarm(math.ceil(patience) + 1)
            try:
                reply = answer(request)
            except Exception as error:
                reply = Failure(f"{type(error).__name__}: {error}")
            signal.alarm(0)
            connection.send(reply)
    except (EOFError, OSError):
        os._exit(0)  # libraries have nothing to tidy up
