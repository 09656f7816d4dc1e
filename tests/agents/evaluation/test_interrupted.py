"""Evaluations whose processes are killed, and those that are interrupted from the keyboard."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from agents.evaluation import run as evaluation
from agents.evaluation.request import Request
from agents.evaluation.work import WORK
from agents.runtime.chunk_store import ChunkStore
from agents.runtime.executors import Backend
from tests.support.waiting import until, worker_processes

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")

NAMES = ("flights.csv", "paths.npz")


def start(out: Path, fields: str, *more: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "agents.cli.main", "evaluate", "--policy", "guided"]
    command += ["--fields", fields, "--out", str(out), *more]
    # no pipe: workers that outlive a killed run would keep it open
    with said_by(out).open("w") as said:
        return subprocess.Popen(
            command, stderr=said, stdout=subprocess.DEVNULL, start_new_session=True
        )


def said_by(out: Path) -> Path:
    return out.with_suffix(".stderr")


@pytest.fixture
def begun() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes to end with the test."""
    runs: list[subprocess.Popen[bytes]] = []
    yield runs
    for run in runs:
        if run.poll() is None:
            run.kill()
        run.wait()


def chunks(out: Path) -> int:
    return len(list((out / WORK).glob("chunk-*")))


def whole(out: Path, fields: int) -> list[bytes]:
    names = [f"sparse/train:{k}" for k in range(fields)]
    evaluation.run(Request(policies=["guided"], fields=names, seeds=range(1)), out, Backend())
    return [(out / name).read_bytes() for name in NAMES]


def test_a_killed_run_is_gone_on_with(tmp_path: Path, begun: list[subprocess.Popen[bytes]]) -> None:
    out = tmp_path / "killed"
    run = start(out, "sparse/train:0-199")
    begun.append(run)
    assert until(lambda: chunks(out) > 0 or run.poll() is not None, 60.0)
    run.kill()
    run.wait()
    assert 0 < chunks(out) < 20
    assert [path.name for path in out.iterdir()] == [WORK]
    assert whole(out, 200) == whole(tmp_path / "whole", 200)
    assert not (out / WORK).exists()


@pytest.mark.slow
def test_workers_end_with_the_run_that_is_killed(
    tmp_path: Path, begun: list[subprocess.Popen[bytes]]
) -> None:
    out = tmp_path / "killed"
    run = start(out, "sparse/train:0-399", "--workers", "2")
    begun.append(run)
    assert until(lambda: chunks(out) > 5 or run.poll() is not None, 60.0)
    below = worker_processes(run.pid)
    assert len(below) == 2
    run.kill()
    assert until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in below))


@pytest.mark.slow
@pytest.mark.filterwarnings("default:a worker process died")
def test_a_worker_that_is_killed_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep, killed = ChunkStore.write, []

    def kill_one(store: ChunkStore, chunk: int, flown: Any) -> None:
        keep(store, chunk, flown)
        if not killed:
            killed.append(worker_processes(os.getpid())[0])
            os.kill(killed[0], signal.SIGKILL)

    monkeypatch.setattr(ChunkStore, "write", kill_one)
    names = [f"sparse/train:{k}" for k in range(60)]
    request = Request(policies=["guided"], fields=names, seeds=range(1), chunk=5)
    evaluation.run(request, tmp_path / "killed", Backend(workers=2))
    assert killed
    monkeypatch.undo()
    one, two = tmp_path / "killed", tmp_path / "whole"
    evaluation.run(request, two, Backend())
    assert [(one / n).read_bytes() for n in NAMES] == [(two / n).read_bytes() for n in NAMES]


@pytest.mark.slow
def test_an_interruption_leaves_work_to_go_on_with_and_no_traces(
    tmp_path: Path, begun: list[subprocess.Popen[bytes]]
) -> None:
    for workers in ("1", "2"):
        out = tmp_path / workers
        run = start(out, "sparse/train:0-399", "--workers", workers)
        begun.append(run)
        assert until(lambda: chunks(out) > 1 or run.poll() is not None, 60.0)  # noqa: B023
        below = worker_processes(run.pid)
        os.killpg(run.pid, signal.SIGINT)  # as a terminal does
        run.wait(timeout=30)
        said = said_by(out).read_text()
        assert run.returncode == 130, said
        assert "Traceback" not in said
        assert said.splitlines()[-2:] == [
            "ferguson: run the same command again to resume",
            "ferguson: interrupted",
        ]
        assert [path.name for path in out.iterdir()] == [WORK]
        assert not list((out / WORK).glob(".writing*"))
        assert until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in below))  # noqa: B023


@pytest.mark.slow
def test_killed_at_twenty_random_moments_the_results_are_those_of_an_uninterrupted_run(
    tmp_path: Path, begun: list[subprocess.Popen[bytes]]
) -> None:
    number = 1000
    out, stream, moments = tmp_path / "killed", random.Random(8), 0
    while moments < 20:
        run = start(out, f"sparse/train:0-{number - 1}", "--workers", "2")
        begun.append(run)
        before = chunks(out)
        assert until(lambda: chunks(out) > before or run.poll() is not None, 60.0)  # noqa: B023
        for victim in stream.sample(["worker", "worker", "main"], 3):
            time.sleep(stream.uniform(0.0, 0.3))
            if run.poll() is not None:
                break
            below = worker_processes(run.pid)
            pid = run.pid if victim == "main" else stream.choice(below or [0])
            if pid and moments < 20:
                os.kill(pid, signal.SIGKILL)
                moments += 1
        if run.poll() is None and moments < 20:
            run.kill()
            moments += 1
        if moments < 20:
            assert (out / WORK).exists(), f"finished after {moments} kills: need more fields"
    for run in begun:
        run.wait()
    assert whole(out, number) == whole(tmp_path / "whole", number)
