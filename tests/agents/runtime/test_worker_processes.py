"""Work in one or several processes: interruption between two calls, and dead workers."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from joblib import delayed

from agents.benchmarks.planners import runs
from agents.cli.main import main
from agents.demonstrations import work
from agents.evaluation import chunks, timing
from agents.evaluation.work import WORK
from agents.runtime.worker_processes import DEATHS, Call, WorkerDiedError, map_in_processes
from tests.support.waiting import until, worker_processes

RESUME = "what is there is kept"


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order(workers: int) -> None:
    calls = (delayed(divmod)(number, 3) for number in range(10))
    with map_in_processes(calls, workers, in_order=True) as results:
        assert list(results) == [divmod(number, 3) for number in range(10)]


def die_at_first(place: Path, deaths: int, number: int) -> int:
    """The number; at the first calls in any process, the process is killed instead."""
    place.mkdir(exist_ok=True)
    if len(list(place.iterdir())) < deaths:
        (place / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize(("in_order", "deaths"), [(True, 1), (False, DEATHS - 1)])
def test_calls_of_workers_that_died_are_run_again(
    in_order: bool, deaths: int, tmp_path: Path
) -> None:
    where = tmp_path / "deaths"
    calls = [delayed(divmod)(number, 3) for number in range(10)]
    calls[4:4] = [delayed(die_at_first)(where, deaths, 7)]
    with (
        pytest.warns(RuntimeWarning, match=r"a worker process died \(SIGKILL\(-9\)") as said,
        map_in_processes(iter(calls), 2, in_order=in_order) as results,
    ):
        found = list(results)
    expected = [divmod(number, 3) for number in range(10)]
    expected[4:4] = [7]
    assert (found if in_order else sorted(found, key=str)) == (
        expected if in_order else sorted(expected, key=str)
    )
    assert len(said) == len({str(one.message) for one in said}) == deaths
    assert len(list(where.iterdir())) == deaths


def test_calls_whose_workers_always_die_are_reported_in_one_line() -> None:
    fatal = delayed(os._exit)(3)

    def run(calls: list[Call]) -> None:
        with map_in_processes(calls, 2, afterwards=RESUME) as results:
            list(results)

    told = rf"died 3 times in a row at the same work \(EXIT\(3\).*fewer --workers.*; {RESUME}$"
    with (
        pytest.warns(RuntimeWarning, match="new workers repeat"),
        pytest.raises(WorkerDiedError, match=told) as died,
    ):
        run([delayed(divmod)(7, 3), fatal])
    assert fatal in died.value.calls


def press(module: Any, name: str, patch: pytest.MonkeyPatch, at: int) -> list[int]:
    """Press Ctrl-C in the middle of call number `at`; returns a list of the finished calls."""
    ended: list[int] = []
    called = getattr(module, name)

    def interrupted(*given: Any, **named: Any) -> Any:
        if len(ended) == at:
            signal.raise_signal(signal.SIGINT)
        found = called(*given, **named)
        ended.append(len(ended))
        return found

    patch.setattr(module, name, interrupted)
    return ended


def test_demonstrations_stop_after_a_flight_and_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    command = ["demos", "--expert", "guided", "--fields", "sparse/train:0-19", "--out", "some-v0"]
    with monkeypatch.context() as patch:
        ended = press(work, "record", patch, at=14)
        assert main(command) == 130
    assert len(ended) == 15  # the flight was finished
    assert capsys.readouterr().err == (
        "ferguson: run the same command again to resume\nferguson: interrupted\n"
    )
    place = tmp_path / ".some-v0.part"
    assert sorted(path.name.split("-")[0] for path in place.iterdir()) == ["chunk", "request.json"]
    flown = press(work, "record", monkeypatch, at=-1)
    assert main([*command, "--json", "--quiet"]) == 0
    assert len(flown) == 10
    out, err = capsys.readouterr()
    assert '"dataset": "some-v0"' in out
    assert '"flights": 20' in out
    assert err == ""
    assert not place.exists()


def test_a_comparison_of_planners_stops_after_a_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = press(runs, "run", monkeypatch, at=2)
    command = ["bench", "planners", "--planner", "shortest", "--fields", "sparse/train:0-4"]
    assert main([*command, "--out", str(tmp_path)]) == 130
    assert len(ended) == 3
    assert capsys.readouterr().err == "ferguson: interrupted\n"
    assert len((tmp_path / "planners.csv").read_text().splitlines()) == 1 + 2


def test_an_evaluation_interrupted_during_timing_repeats_only_the_timing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["evaluate", "--policy", "shortest", "--fields", "sparse/train:0-4", "-q"]
    command += ["--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        ended = press(timing, "fly", patch, at=1)
        assert main(command) == 130
    assert len(ended) == 2  # the flight was finished
    assert [path.name for path in tmp_path.iterdir()] == [WORK]
    monkeypatch.setattr(chunks, "fly", lambda *_: 1 / 0)
    assert main(command) == 0
    assert (tmp_path / "summary.json").exists()


COMMANDS = {
    "demos": "demos --expert guided --fields sparse/train:0-399 --out some-v0 --workers 2",
    "dagger": "train dagger --steps 20000 --workers 2 --out {}/runs",
    "bench": "bench planners --planner guided --fields sparse/train:0-399 --workers 2 --out {}/b",
}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
@pytest.mark.parametrize("what", COMMANDS)
@pytest.mark.parametrize("killed", [False, True])
def test_commands_replace_a_killed_worker_and_leave_nothing_running_after_ctrl_c(
    what: str, killed: bool, tmp_path: Path
) -> None:
    pytest.importorskip({"demos": "minari", "dagger": "sb3_contrib"}.get(what, "joblib"))
    with subprocess.Popen(
        [sys.executable, "-m", "agents.cli.main", *COMMANDS[what].format(tmp_path).split()],
        env={**os.environ, "MINARI_DATASETS_PATH": str(tmp_path)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as run:
        assert until(lambda: len(worker_processes(run.pid)) == 2 or run.poll() is not None, 120.0)
        time.sleep(1.0)
        workers = worker_processes(run.pid)
        if killed:
            os.kill(workers[0], signal.SIGKILL)
            assert until(lambda: len({*worker_processes(run.pid)} - {*workers}) == 2, 60.0)
            workers += worker_processes(run.pid)
        os.killpg(run.pid, signal.SIGINT)  # as a terminal does
        assert run.stderr is not None
        lines = run.stderr.read().splitlines()
    assert until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers))
    assert {path.name for path in tmp_path.iterdir()} <= {".some-v0.part", "runs", "b"}
    assert "Traceback" not in "".join(lines)
    assert run.returncode == 130
    assert lines[-1] == "ferguson: interrupted"
    warned = [line for line in lines if line.startswith("ferguson: warning: ")]
    assert len(warned) == killed
    assert all("a worker process died (SIGKILL(-9))" in line for line in warned)
