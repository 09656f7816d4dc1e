"""Without a terminal, progress is a line a minute."""

import io
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from agents.runtime import progress_lines
from agents.runtime.progress_lines import ProgressLines
from agents.runtime.terminal import Terminal
from tests.support.waiting import until


def often(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """Standard error that is no terminal; lines come every 20 ms."""
    stream = io.StringIO()
    monkeypatch.setattr(progress_lines, "EVERY", 0.02)
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_a_thread_writes_unfinished_tasks_and_stops(
    monkeypatch: pytest.MonkeyPatch, started: Callable[[], list[threading.Thread]]
) -> None:
    written = often(monkeypatch)
    with Terminal().bar() as bar:
        flights = bar.add_task("flights", total=1200)
        bar.advance(flights, 1100)
        done = bar.add_task("writing", total=1)
        bar.advance(done)
        before = written.getvalue()
        assert until(lambda: written.getvalue().count("\n") >= before.count("\n") + 3)
    # a line may have been half written before
    lines = written.getvalue().removeprefix(before).splitlines()[1:]
    assert set(lines) == {"flights: 1,100 of 1,200, after 0 min"}
    assert until(lambda: not started())
    before = written.getvalue()
    time.sleep(0.1)
    assert written.getvalue() == before


def test_shares_and_tasks_without_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    written = often(monkeypatch)
    with Terminal().share_bar() as bar:
        bar.add_task("ppo, 1,234 steps", total=1.0, completed=0.34)
        bar.add_task("first flights", total=None)
        assert until(lambda: "first" in written.getvalue())
    lines = set(written.getvalue().splitlines())
    assert lines == {"ppo, 1,234 steps: 34%, after 0 min", "first flights, after 0 min"}


def test_timed_parts_are_not_disturbed_by_a_thread(
    monkeypatch: pytest.MonkeyPatch, started: Callable[[], list[threading.Thread]]
) -> None:
    written = often(monkeypatch)
    with Terminal().still_bar() as bar:
        for _ in bar.track(range(3), description="times"):
            assert started() == []
            time.sleep(0.03)
    assert written.getvalue().splitlines() == [f"times: {n} of 3, after 0 min" for n in (1, 2)]


def test_quiet_commands_write_no_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    written = often(monkeypatch)
    with Terminal(quiet=True).bar() as bar:
        bar.add_task("flights", total=2)
        time.sleep(0.1)
    assert written.getvalue() == ""


@pytest.mark.parametrize(
    ("seconds", "text"), [(59.0, "1 min"), (3540.0, "59 min"), (3600.0, "1 h 00 min")]
)
def test_times_are_in_minutes(seconds: float, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    progress: Any = ProgressLines(lines.append)
    progress.add_task("dagger", total=2.0, completed=0.5)
    (task,) = progress.tasks
    task.start_time -= seconds
    assert progress._line(task) == f"dagger: 0 of 2, after {text}"
