"""A training says where it is: a line a minute without a terminal, and a file in its directory."""

import io
import json
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("stable_baselines3")

from agents.runtime import progress_lines
from agents.runtime.terminal import Terminal
from agents.training import progress
from agents.training.budget import TrainingBudget
from agents.training.progress import show_progress
from tests.support.waiting import until

ROW = {"steps": 1000, "minutes": 2.5, "success": 0.855, "spl": 0.81234, "gap": None}


def training(place: Path, **limits: Any) -> tuple[Any, Any, TrainingBudget]:
    """Run, record and budget of a training after 90 seconds and 1,234 steps."""
    given: dict[str, Any] = {"most_steps": None, "minutes": None, **limits}
    run = SimpleNamespace(
        algorithm="dagger", directory=place, chosen_on="a/b:1", terminal=Terminal(), **given
    )
    budget = TrainingBudget(given["most_steps"], given["minutes"], 1234, 90.0)
    return run, SimpleNamespace(curve=[], best=None), budget


def test_the_file_says_where_the_training_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    run, record, budget = training(tmp_path, minutes=35.0)

    def read() -> dict[str, Any]:
        return json.loads((tmp_path / "progress.json").read_text())  # type: ignore[no-any-return]

    with show_progress(run, record, budget) as shown:
        found = read()
        assert datetime.now(UTC) - datetime.fromisoformat(found.pop("updated")) < timedelta(hours=1)
        assert found.pop("minutes") == pytest.approx(1.5, abs=0.4)
        assert found == {
            **{"status": "training", "steps": 1234, "max_steps": None, "max_minutes": 35.0},
            **{"validation": None, "best_spl": None, "model": None},
        }
        budget.steps = 2000
        shown.update()
        assert read()["steps"] == 1234  # a minute has not passed
        record.curve.append(ROW)
        record.best = 0.9
        monkeypatch.setattr(progress, "EVERY", 0.0)
        shown.update()  # an evaluation is written at once
        assert read()["steps"] == 2000
        assert read()["validation"] == {"fields": "a/b:1", **ROW}
        assert read()["model"] == str(tmp_path / "best")
        budget.steps = 3000
        shown.update()  # enough time has passed
        assert read()["steps"] == 3000
    assert read()["status"] == "training"  # the final model is still to be evaluated


def test_a_training_that_is_interrupted_is_marked_as_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with pytest.raises(KeyboardInterrupt), show_progress(*training(tmp_path)):
        raise KeyboardInterrupt
    assert json.loads((tmp_path / "progress.json").read_text())["status"] == "stopped"


@pytest.mark.parametrize(
    ("limits", "evaluated", "line"),
    [
        ({"minutes": 35.0}, False, "dagger: 1,234 steps, 1.5 of 35 min, not yet evaluated"),
        (
            {"most_steps": 9000},
            True,
            "dagger: 1,234 of 9,000 steps, 1.5 min; at 1,000 steps success 85.5%, SPL 0.8123",
        ),
    ],
)
def test_without_a_terminal_lines_say_where_the_training_is(
    limits: dict[str, Any],
    evaluated: bool,
    line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    monkeypatch.setattr(progress_lines, "EVERY", 0.02)
    run, record, budget = training(tmp_path, **limits)
    if evaluated:
        record.curve.append(ROW)
    with show_progress(run, record, budget):
        assert until(lambda: "\n" in written.getvalue())
    assert set(written.getvalue().splitlines()) == {line}
