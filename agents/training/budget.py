"""The budget of a training in steps and time, and schedules that follow it."""

from __future__ import annotations

import time
from dataclasses import dataclass

STOPPING = b"ferguson: stopping after this update, with a checkpoint; Ctrl-C again: at once\n"
"""Notice when Ctrl-C is pressed in a training."""


class TrainingBudget:
    """Steps and time of a training, including those before it was resumed; None: no limit."""

    def __init__(
        self, max_steps: int | None, max_minutes: float | None, steps: int = 0, seconds: float = 0
    ) -> None:
        self.steps = steps
        """Steps taken so far; the trainer keeps it up to date."""
        self._max_steps, self._max_minutes = max_steps, max_minutes
        self.start(seconds)

    def start(self, seconds: float) -> None:
        """Start the clock at this number of seconds."""
        self._began = time.monotonic() - seconds

    @property
    def seconds(self) -> float:
        """Time spent so far [s]."""
        return time.monotonic() - self._began

    @property
    def done(self) -> float:
        """Share of the budget that is used, in [0, 1], by the limit that comes first."""
        by_steps = self.steps / self._max_steps if self._max_steps else 0.0
        by_time = self.seconds / (60.0 * self._max_minutes) if self._max_minutes else 0.0
        return min(max(by_steps, by_time), 1.0)

    @property
    def time_is_up(self) -> bool:
        """Whether the limit of time is reached."""
        return self._max_minutes is not None and self.seconds >= 60.0 * self._max_minutes


@dataclass(frozen=True, slots=True)
class LinearSchedule:
    """A value that decreases linearly with the budget; a schedule of Stable-Baselines3."""

    value: float
    budget: TrainingBudget
    least: float = 0.0
    """Share of the value that is left at the end; 1 keeps it constant."""

    def __call__(self, _: float = 1.0) -> float:
        """The value now; the library's own measure of progress knows no limit of time."""
        return self.value * max(1.0 - self.budget.done, self.least)
