"""A worker may crash, hang or fail: the caller gets an error, and the next request an answer."""

import gc
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time

import pytest

from planners.interface import CrashedError
from planners.whole_path.subprocess_worker import ROOT, Worker

STUB = "tests.support.processes.stub_worker"


@pytest.fixture(scope="module")
def worker() -> Worker:
    return Worker(STUB)


def is_alive(pid: int) -> bool:
    """Whether a child of this process runs, or has ended and was not waited for."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_one_process_answers_one_request_after_the_other(worker: Worker) -> None:
    first, second = worker.ask("one", 30.0), worker.ask("two", 30.0)
    assert first == ("one", worker.pid)
    assert second == ("two", worker.pid)


def test_output_of_a_library_does_not_disturb_the_answer(
    worker: Worker, capfd: pytest.CaptureFixture[str]
) -> None:
    assert worker.ask("print", 30.0)[0] == "print"
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    ("request_", "timeout", "message"),
    [
        ("crash", 30.0, "tests.support.processes.stub_worker ended with exit status -11"),
        ("hang", 0.2, "tests.support.processes.stub_worker did not answer within 0.2 s"),
    ],
)
def test_after_a_crash_or_a_hang_the_next_request_starts_another_process(
    worker: Worker, request_: str, timeout: float, message: str
) -> None:
    _, before = worker.ask("one", 30.0)
    with pytest.raises(CrashedError, match=message):
        worker.ask(request_, timeout)
    assert worker.pid is None
    assert not is_alive(before)
    assert worker.ask("two", 30.0) == ("two", worker.pid)
    assert worker.pid != before


def test_an_exception_is_reported_and_the_process_stays(worker: Worker) -> None:
    _, pid = worker.ask("one", 30.0)
    with pytest.raises(CrashedError, match="ValueError: no such thing"):
        worker.ask("fail", 30.0)
    assert worker.ask("two", 30.0) == ("two", pid)


def test_a_process_killed_between_requests_is_replaced(worker: Worker) -> None:
    _, pid = worker.ask("one", 30.0)
    os.kill(pid, signal.SIGKILL)
    time.sleep(0.1)
    assert worker.ask("two", 30.0)[0] == "two"
    assert not is_alive(pid)


def test_a_module_that_does_not_start_has_crashed(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(CrashedError, match="ended with exit status 1"):
        Worker("tests.no_such_worker").ask("one", 30.0)
    assert "No module named tests.no_such_worker" in capfd.readouterr().err


def test_the_process_ends_with_its_worker() -> None:
    worker = Worker(STUB)
    assert worker.pid is None
    _, pid = worker.ask("one", 30.0)
    del worker
    gc.collect()
    assert not is_alive(pid)


def test_a_copy_has_a_process_of_its_own(worker: Worker) -> None:
    _, pid = worker.ask("one", 30.0)
    copy = pickle.loads(pickle.dumps(worker))
    assert copy.pid is None
    assert copy.ask("one", 30.0) == ("one", copy.pid)
    assert copy.pid != pid


@pytest.mark.parametrize(
    ("end", "during"),
    [
        (signal.SIGINT, "hang"),
        (signal.SIGKILL, "one"),
        pytest.param(signal.SIGKILL, "hang", marks=pytest.mark.slow),
    ],
)
def test_when_the_program_is_ended_its_worker_ends(end: signal.Signals, during: str) -> None:
    program = f"""
        import signal
        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored behind a shell's &
        from planners.whole_path.subprocess_worker import Worker
        worker = Worker("{STUB}")
        worker.ask("one", 30.0)
        print("ready", flush=True)
        worker.ask("{during}", 1.0)
        import time
        time.sleep(600.0)
    """
    # the worker holds standard error open as long as it lives
    running = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stdout is not None
    assert running.stdout.readline() == "ready\n"
    time.sleep(0.3)
    running.send_signal(end)
    _, errors = running.communicate(timeout=20.0)
    assert running.returncode == -end
    assert ("KeyboardInterrupt" in errors) == (end == signal.SIGINT)
