"""Threads that share a compiled loop: pieces of work are claimed from an atomic counter.

Whoever calls for the work does it, too, and waits for pieces that others have begun, never
for a thread that has not come: on a busy machine the work is done alone, at no loss. (A team
of OpenMP threads waits for each of its members, milliseconds where another process runs.)
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
"""Two numbers: pieces claimed, pieces done."""

CLAIMED, DONE = 0, 1
PATIENCE = 250_000
"""Looks at the counter, about a tenth of a millisecond, before a thread goes to sleep."""


def new_counters() -> Counters:
    """Nothing to do, and nothing done."""
    return np.array([2**62, 0], np.int64)


def _exchange(operation: str) -> Any:
    """An atomic change of a counter by an operation of LLVM; it returns what the counter was."""

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
    """Threads that help with one job for as long as it lives.

    Args:
        help_out: does pieces of the job while there are any, without the interpreter's lock,
            and returns when none came for a while.
        size: number of threads.
    """

    def __init__(self, help_out: Callable[[], None], size: int) -> None:
        self._bells = [_Bell() for _ in range(size)]
        weakref.finalize(self, _dismiss, self._bells)
        for bell in self._bells:
            threading.Thread(target=_serve, args=(bell, help_out), daemon=True).start()

    def call(self) -> None:
        """Wake those who sleep."""
        for bell in self._bells:
            bell.ring()


class _Bell:
    """Wakes one thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lock.acquire()
        self._asleep = True
        self.over = False

    def ring(self) -> None:
        if self._asleep:
            self._asleep = False
            self._lock.release()

    def sleep(self) -> None:
        self._asleep = True
        if not self.over:  # which may have come while there was no need to ring
            self._lock.acquire()


def _serve(bell: _Bell, help_out: Callable[[], None]) -> None:
    bell._lock.acquire()
    while not bell.over:
        help_out()
        bell.sleep()


def _dismiss(bells: list[_Bell]) -> None:
    for bell in bells:
        bell.over = True
        bell.ring()
