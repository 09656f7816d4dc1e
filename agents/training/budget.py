"""How far a training is, and whether it is to stop: steps, time, and Ctrl-C."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

_STOPPING = b"ferguson: stopping after this update, with a checkpoint; Ctrl-C again: at once\n"


class TrainingBudget:
    """Steps and seconds of a training, those of earlier sittings among them."""

    def __init__(
        self, most_steps: int | None, most_minutes: float | None, steps: int = 0, seconds: float = 0
    ) -> None:
        self.steps = steps
        """So far; whoever trains keeps it up to date."""
        self._most_steps, self._most_minutes = most_steps, most_minutes
        self.start(seconds)

    def start(self, seconds: float) -> None:
        """Let the time go on from so many seconds."""
        self._began = time.monotonic() - seconds

    @property
    def seconds(self) -> float:
        """So far."""
        return time.monotonic() - self._began

    @property
    def done(self) -> float:
        """Part of the training that is over, 0 to 1; by whichever limit comes first."""
        by_steps = self.steps / self._most_steps if self._most_steps else 0.0
        by_time = self.seconds / (60.0 * self._most_minutes) if self._most_minutes else 0.0
        return min(max(by_steps, by_time), 1.0)

    @property
    def time_is_up(self) -> bool:
        """Whether the limit of time is reached."""
        return self._most_minutes is not None and self.seconds >= 60.0 * self._most_minutes


@dataclass(frozen=True, slots=True)
class LinearSchedule:
    """A schedule of Stable-Baselines3: from a value to 0, in step with the training."""

    value: float
    pace: TrainingBudget

    def __call__(self, _: float) -> float:
        """The value now; the library's own count knows no limit of time."""
        return self.value * (1.0 - self.pace.done)


class Stop:
    """Whether Ctrl-C was pressed."""

    def __init__(self) -> None:
        self.asked = False


@contextmanager
def stop_on_interrupt() -> Iterator[Stop]:
    """Turn the first Ctrl-C into a wish to stop at the next good moment.

    The second one interrupts at once, as ever. Outside the main thread nothing is changed.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before: Any = signal.getsignal(signal.SIGINT)

    def ask(_: int, __: FrameType | None) -> None:
        stop.asked = True
        signal.signal(signal.SIGINT, before)
        os.write(2, _STOPPING)  # a handler may come in the middle of any other writing

    signal.signal(signal.SIGINT, ask)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
