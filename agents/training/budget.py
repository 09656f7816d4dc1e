"""How far a training is: steps and time."""

from __future__ import annotations

import time
from dataclasses import dataclass

STOPPING = b"ferguson: stopping after this update, with a checkpoint; Ctrl-C again: at once\n"
"""What Ctrl-C answers in a training."""


class TrainingBudget:
    """Steps and seconds of a training, those of earlier sittings among them."""

    def __init__(
        self, most_steps: int | None, most_minutes: float | None, steps: int = 0, seconds: float = 0
    ) -> None:
        self.steps = steps
        """So far; the trainer keeps it up to date."""
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
