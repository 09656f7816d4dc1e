"""Where a training is: on the progress bar, as a line a minute, and as a file in its directory."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

from rich.progress import Progress

from agents.training.budget import TrainingBudget
from agents.training.learning_curve import BEST, TrainingRecord
from agents.training.run import PROGRESS, Run
from ferguson_gym.runtime.atomic_files import atomic_write

EVERY = 60.0
"""Time after which the file is written again [s]; an evaluation writes it, too."""


class TrainingProgress:
    """Shows and writes where a training is, whenever the trainer calls `update`."""

    def __init__(
        self, run: Run, record: TrainingRecord, budget: TrainingBudget, bar: Progress
    ) -> None:
        self._run, self._record, self._budget, self._bar = run, record, budget, bar
        self._task = bar.add_task(run.algorithm, total=1.0)
        self._due, self._evaluations = 0.0, 0
        self.update()

    def update(self, activity: str = "") -> None:
        """Show the present state; `activity` names what is done, if not the usual."""
        name = f"{self._run.algorithm}, {activity}" if activity else self._run.algorithm
        best, evaluations = self._record.best, len(self._record.curve)
        short = f"{name}, {self._budget.steps:,} steps"
        self._bar.update(
            self._task,
            completed=self._budget.done,
            description=short if best is None else f"{short}, best SPL {best:.4f}",
            line=f"{name}: {format_state(self._run, self._record, self._budget)}",
        )
        now = time.monotonic()
        if now >= self._due or evaluations != self._evaluations:
            write_progress(self._run, self._record, self._budget)
            self._due, self._evaluations = now + EVERY, evaluations


@contextmanager
def show_progress(
    run: Run, record: TrainingRecord, budget: TrainingBudget
) -> Iterator[TrainingProgress]:
    """Show a bar, or lines where none can be drawn; a block that raises marks the run stopped."""
    with run.terminal.share_bar() as bar:
        try:
            yield TrainingProgress(run, record, budget, bar)
        except BaseException:
            write_progress(run, record, budget, "stopped")
            raise


def format_state(run: Run, record: TrainingRecord, budget: TrainingBudget) -> str:
    """Steps and time, of those given, and the latest evaluation, as a line of text."""
    steps = "" if run.most_steps is None else f" of {run.most_steps:,}"
    minutes = "" if run.minutes is None else f" of {run.minutes:g}"
    text = f"{budget.steps:,}{steps} steps, {budget.seconds / 60.0:.1f}{minutes} min"
    if not record.curve:
        return f"{text}, not yet evaluated"
    last = record.curve[-1]
    return (
        f"{text}; at {last['steps']:,} steps success {last['success']:.1%}, SPL {last['spl']:.4f}"
    )


def write_progress(
    run: Run, record: TrainingRecord, budget: TrainingBudget, status: str = "training"
) -> None:
    """Write where a training is to its directory; `status` is training, stopped or finished."""
    best = run.directory / BEST if record.best is not None else None
    found = {
        "status": status,
        "updated": datetime.now(UTC).isoformat(timespec="seconds"),
        "steps": budget.steps,
        "max_steps": run.most_steps,
        "minutes": round(budget.seconds / 60.0, 3),
        "max_minutes": run.minutes,
        "validation": {"fields": run.chosen_on, **record.curve[-1]} if record.curve else None,
        "best_spl": record.best,
        "model": str(run.directory if status == "finished" else best) if best else None,
    }
    with atomic_write(run.directory / PROGRESS) as temporary:
        temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
