"""Threads that share a compiled loop: pieces of work are claimed from an atomic counter.

The calling thread works, too, and waits only for pieces that other threads have claimed, never for
a thread that has not started. On a busy machine it therefore does all the work itself and loses no
time by waiting. (OpenMP waits for all threads of a team; on a busy machine this costs
milliseconds.)
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

Counters = NDArray[np.int64]
"""Two numbers (2,): pieces claimed, pieces done."""

CLAIMED, DONE = 0, 1
SPIN_LIMIT = 250_000
"""How often a thread polls the counter, about a tenth of a millisecond, before it sleeps."""


def new_counters() -> Counters:
    """Counters of a job without work: every piece counts as claimed, none as done."""
    return np.array([2**62, 0], np.int64)


def _exchange(operation: str) -> Any:
    """An atomic change of a counter by an operation of LLVM; returns the counter's old value."""

    @intrinsic
    def exchange(_: Any, counters: Any, index: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = _pointer(context, builder, signature, arguments)
            return builder.atomic_rmw(operation, pointer, arguments[2], "seq_cst")

        return types.int64(counters, types.int64, types.int64), generate

    return exchange


@intrinsic
def _get(_: Any, counters: Any, index: Any) -> Any:
    """A counter's value, atomically."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = _pointer(context, builder, signature, arguments)
        return builder.load_atomic(pointer, "seq_cst", 8)

    return types.int64(counters, types.int64), generate


def _pointer(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = signature.args[0]
    struct = context.make_array(array)(context, builder, arguments[0])
    return cgutils.get_item_pointer(  # type: ignore[no-untyped-call]
        context, builder, array, struct, [arguments[1]]
    )


# typed as they are called from compiled functions
add = cast("Callable[[Counters, int, int], int]", _exchange("add"))
put = cast("Callable[[Counters, int, int], int]", _exchange("xchg"))
get = cast("Callable[[Counters, int], int]", _get)


class HelperThreads:
    """Threads that help with one job for as long as this object lives.

    Args:
        help_out: does pieces of the job while there are any, without the interpreter's lock;
            returns when it found no piece for a while.
        size: number of threads.
    """

    def __init__(self, help_out: Callable[[], None], size: int) -> None:
        self._signals = [_WakeSignal() for _ in range(size)]
        weakref.finalize(self, _stop, self._signals)
        for signal in self._signals:
            threading.Thread(target=_serve, args=(signal, help_out), daemon=True).start()

    def wake(self) -> None:
        """Wake the threads that sleep."""
        for signal in self._signals:
            signal.send()


class _WakeSignal:
    """Wakes one thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()
        self._asleep = True
        self.over = False

    def send(self) -> None:
        if self._asleep:
            self._asleep = False
            self._lock.release()

    def sleep(self) -> None:
        self._asleep = True
        if not self.over:  # it may have been set while the thread was awake
            self._lock.acquire()


def _serve(signal: _WakeSignal, help_out: Callable[[], None]) -> None:
    signal._lock.acquire()
    while not signal.over:
        help_out()
        signal.sleep()


def _stop(signals: list[_WakeSignal]) -> None:
    for signal in signals:
        signal.over = True
        signal.send()
