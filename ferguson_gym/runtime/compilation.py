"""What happens around the compilation of kernels: a notice explains the wait.

The notice and warnings go to the loggers below `ferguson_gym`, which print on standard error unless
a program configures them. They are not Python warnings, because nothing is wrong and programs that
turn warnings into errors should run.
"""

from __future__ import annotations

import gc
import logging
from collections.abc import Collection
from typing import Any

from numba.core import event

from ferguson_gym.runtime import cache_directory

COMPILING = (
    "ferguson-gym compiles its numerical kernels, on the first run only: up to a minute or two"
)
PACKAGE = "ferguson_gym"
"""Name of the logger above those of this package."""
_log = logging.getLogger(__name__)


class Compilation(event.Listener):
    """Announces the first compilation of some packages' kernels, and makes compilations shorter.

    The compiler allocates millions of small objects that live until it is done. The garbage
    collector would search all of them again and again, a fifth of the time, so it pauses.
    """

    def __init__(self, packages: Collection[str]) -> None:
        self._packages = packages
        self._announced = False
        self._nested = 0
        self._collecting = False

    # Numba's lock is held from each start to its end
    def on_start(self, event: Any) -> None:
        """A compilation starts, perhaps within another one."""
        if not self._concerns(event):
            return
        if self._nested == 0:
            self._collecting = gc.isenabled()
            gc.disable()
        self._nested += 1
        if not self._announced:
            self._announced = True
            if (problem := cache_directory.warning()) is not None:
                logging.getLogger(cache_directory.__name__).warning(problem)
            _log.warning(COMPILING)

    def on_end(self, event: Any) -> None:
        """A compilation ends, or fails."""
        if not self._concerns(event):
            return
        self._nested -= 1
        if self._nested == 0 and self._collecting:
            gc.enable()

    def _concerns(self, event: Any) -> bool:
        module: str = event.data["dispatcher"].py_func.__module__
        return module.partition(".")[0] in self._packages


def watch(packages: Collection[str]) -> None:
    """Announce the first compilation of these packages' kernels in this process."""
    # loading from a cache is no event
    event.register("numba:compile", Compilation(packages))  # type: ignore[no-untyped-call]
