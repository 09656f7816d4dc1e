"""A case of the fuzz run: counted, held to a time, refused only by errors that are meant."""

from __future__ import annotations

import contextlib
import dis
import faulthandler
import functools
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.strategies import SearchStrategy

from tests.support.places import ROOT

COUNTS: Counter[str] = Counter()
"""Cases by entry point, of this process."""
REFUSED: Counter[str] = Counter()
"""In how many of them something was refused, by an error that is meant."""
LARGE = 1_000_000
"""Examples in the profile of the large run: each entry point then has its many."""
SLOW = 30.0
"""Processor time that a case of the large run may take [s]; but for the first, which compiles."""
HANG = 300.0
"""Processor time after which a case is taken to hang: the process ends and says where [s]."""
_OURS = tuple(str(ROOT / package) for package in ("ferguson_gym", "planners", "agents"))
_RAISE = dis.opmap["RAISE_VARARGS"]
_LONGEST = 1500
"""Characters of a message; one that names all planners is long."""
_refused = False
"""Whether the case that runs has met such an error."""


def fuzzed(
    entry: str, *, few: int = 10, many: int = 2000, **strategies: SearchStrategy[Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a test of one entry point, or a family of them, that hypothesis calls with cases.

    Args:
        entry: its name, by which cases are counted.
        few: cases in the default run.
        many: cases in the large run.
        strategies: of the test's arguments; others are fixtures.
    """

    is_large = settings().max_examples >= LARGE

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def case(*args: Any, **kwargs: Any) -> None:
            global _refused
            _refused = False
            COUNTS[entry] += 1
            began = time.process_time()
            with _ended_if_it_hangs():
                test(*args, **kwargs)
            taken = time.process_time() - began
            REFUSED[entry] += _refused
            quick = taken < SLOW or COUNTS[entry] == 1 or not is_large
            assert quick, f"{entry} took {taken:.1f} s of processor time"

        chosen = settings(
            max_examples=many if is_large else few,
            deadline=None,
            derandomize=not is_large,
            database=None,
            print_blob=True,
            phases=[Phase.explicit, Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        )
        return chosen(given(**strategies)(case))

    return decorate


@contextlib.contextmanager
def _ended_if_it_hangs() -> Iterator[None]:
    """Compiled code hears no exception: the process is ended, after all threads have said where."""
    if not hasattr(signal, "SIGVTALRM"):  # Windows
        yield
        return
    faulthandler.register(signal.SIGVTALRM, file=sys.__stderr__, all_threads=True, chain=True)
    signal.setitimer(signal.ITIMER_VIRTUAL, HANG)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        faulthandler.unregister(signal.SIGVTALRM)


def attempt(
    call: Callable[..., Any],
    *args: Any,
    errors: tuple[type[Exception], ...] = (ValueError, TypeError),
    **kwargs: Any,
) -> Any:
    """What a call returns; None where it refuses, by an error that is meant.

    Any other error goes on to the test, which fails.
    """
    try:
        return call(*args, **kwargs)
    except errors as error:
        if not is_meant(error):
            raise AssertionError(f"an error that nobody meant: {error!r}") from error
        note_refusal()
        return None


def note_refusal() -> None:
    """Count the case that runs as one in which something was refused."""
    global _refused
    _refused = True


def is_meant(error: BaseException) -> bool:
    """Whether an error was raised on purpose by this project, and has one clear sentence."""
    frame = error.__traceback__
    assert frame is not None
    while frame.tb_next is not None:
        frame = frame.tb_next
    code = frame.tb_frame.f_code
    message = str(error)
    return (
        code.co_filename.startswith(_OURS)
        and code.co_code[frame.tb_lasti] == _RAISE
        and 10 <= len(message) <= _LONGEST
        and "\n" not in message
    )


def table() -> list[str]:
    """The counts, for people."""
    width = max(map(len, COUNTS), default=0)
    lines = [
        f"{entry:{width}} {count:>8,} cases, {REFUSED[entry]:>8,} refused"
        for entry, count in sorted(COUNTS.items())
    ]
    return [*lines, f"{'in all':{width}} {sum(COUNTS.values()):>8,} cases"]
