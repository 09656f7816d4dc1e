"""Threads that help: every piece is done once, and they end when their owner does."""

import gc
import os
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
import numpy as np
import pytest

from ferguson_gym import batch, fleet
from ferguson_gym.crew import CLAIMED, DONE, Crew, add, get, new_counters, put
from ferguson_gym.fields import Field
from ferguson_gym.obstacles import Discs
from ferguson_gym.vector_environment import VectorObstacleField

ROOT = Path(__file__).parent.parent
OPEN = Field(name="open", obstacles=Discs([], []))
PATIENT = 20_000


@numba.njit(nogil=True)
def do_pieces(counters: np.ndarray, times: np.ndarray, patience: int) -> None:
    idle = 0
    while idle <= patience:
        idle += 1
        if get(counters, CLAIMED) < len(times):
            piece = add(counters, CLAIMED, 1)
            if piece < len(times):
                times[piece] += 1
                add(counters, DONE, 1)
                idle = 0


@numba.njit(nogil=True)
def do_job(counters: np.ndarray, times: np.ndarray) -> None:
    put(counters, DONE, 0)
    put(counters, CLAIMED, 0)
    do_pieces(counters, times, 0)
    while get(counters, DONE) < len(times):
        pass


@numba.njit(nogil=True)
def set_out(counters: np.ndarray) -> None:
    put(counters, DONE, 0)
    put(counters, CLAIMED, 0)


@numba.njit
def read(counters: np.ndarray, index: int) -> int:
    return get(counters, index)


@numba.njit
def changed(counters: np.ndarray) -> tuple[int, int, int]:
    return add(counters, DONE, 5), put(counters, DONE, 3), get(counters, DONE)


def until(condition: Callable[[], bool], seconds: float = 20.0) -> bool:
    """Whether it comes true within this time; the machine may be busy."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.001)
    return True


@pytest.fixture
def started() -> Iterator[Callable[[], list[threading.Thread]]]:
    """Threads alive that a test has started; at its end there must be none."""
    before = set(threading.enumerate())

    def mine() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread not in before]

    yield mine
    gc.collect()
    assert until(lambda: not mine()), mine()


def test_counters() -> None:
    counters = new_counters()
    assert read(counters, CLAIMED) > 2**60  # nothing is left to claim
    assert read(counters, DONE) == 0
    assert changed(counters) == (0, 5, 3)
    assert counters.tolist() == [2**62, 3]


@pytest.mark.parametrize("helpers", [0, 1, 2, 3])
def test_each_piece_is_done_exactly_once(helpers: int, started: Callable) -> None:
    stream = np.random.default_rng(helpers)
    for size in (0, 1, 2, *stream.integers(3, 200, 20)):
        counters, times = new_counters(), np.zeros(size, np.int64)
        crew = Crew(lambda c=counters, t=times: do_pieces(c, t, PATIENT), helpers)
        assert len(started()) >= helpers
        for job in range(1, 101):
            crew.call()
            do_job(counters, times)
            assert (times == job).all()
        del crew


def test_helpers_do_the_work_alone_and_wake_for_every_call(started: Callable) -> None:
    counters, times = new_counters(), np.zeros(500, np.int64)
    crew = Crew(lambda: do_pieces(counters, times, 10), 3)
    for job in range(1, 60):
        if job % 10 == 0:
            time.sleep(0.01)  # they are asleep for sure
        while not all(bell._asleep for bell in crew._bells):
            time.sleep(0.0001)
        set_out(counters)
        crew.call()
        assert until(lambda: read(counters, DONE) == 500)
        assert (times == job).all()
    assert len(started()) == 3


def test_calls_at_any_moment_break_nothing(started: Callable) -> None:
    count = [0]

    def help_out() -> None:
        count[0] += 1

    crew = Crew(help_out, 3)
    for _ in range(20_000):
        crew.call()
    assert until(lambda: all(bell._asleep for bell in crew._bells))
    before = count[0]
    crew.call()
    assert until(lambda: count[0] == before + 3)
    assert len(started()) == 3


def test_threads_end_with_their_owner_before_they_were_called(started: Callable) -> None:
    crew = Crew(lambda: None, 2)
    assert len(started()) == 2
    del crew
    assert until(lambda: not started())


def test_threads_end_with_their_owner_in_the_middle_of_work(started: Callable) -> None:
    begun, over = threading.Event(), threading.Event()

    def help_out() -> None:
        begun.set()
        over.wait(20.0)

    crew = Crew(help_out, 2)
    crew.call()
    assert begun.wait(20.0)
    del crew
    over.set()
    assert until(lambda: not started())


@pytest.mark.parametrize("wait", [0.0, 0.05])
def test_a_vector_environment_that_goes_takes_threads_and_memory_along(
    wait: float, monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(fleet.numba, "get_num_threads", lambda: 4)
    for _ in range(5):
        envs = VectorObstacleField(70, fields=1)
        envs.reset(seed=0)
        assert not started()
        envs.step(np.zeros((70, 4), np.float32))
        assert len(started()) == 3
        alive = [weakref.ref(thing) for thing in (envs._fleet, envs._fleet._job.actions)]
        time.sleep(wait)
        del envs
        assert alive[0]() is None
        assert until(lambda: not started())
        assert alive[1]() is None


def test_every_vehicle_is_stepped_once_a_step(
    monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(fleet.numba, "get_num_threads", lambda: 4)
    number = 5 * batch.CHUNK + 3
    envs = VectorObstacleField(number, autoreset_mode="Disabled", fields=1, obstacles=0)
    still = np.zeros((number, 4), np.float32)
    for _ in range(150):
        envs.reset(options={"field": OPEN})
        for flown in range(1, 16):
            *_, infos = envs.step(still)
            assert (infos["segments"] == flown).all()
    assert len(started()) == 3


def flown(seed: int) -> bytes:
    envs = VectorObstacleField(66, fields=20, autoreset_mode="SameStep")
    envs.reset(seed=seed)
    stream = np.random.default_rng(seed)
    results = []
    for _ in range(30):
        actions = stream.uniform(-0.1, 0.1, (66, 4)).astype(np.float32)
        seen, reward, *_, infos = envs.step(actions)
        results += [*seen.values(), reward, infos["clearance"]]
    return b"".join(array.tobytes() for array in results)


def test_many_environments_in_many_threads(
    monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(fleet.numba, "get_num_threads", lambda: 3)
    expected = [flown(seed) for seed in range(6)]
    got: dict[int, bytes] = {}
    threads = [
        threading.Thread(target=lambda seed=seed: got.update({seed: flown(seed)}))
        for seed in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [got[seed] for seed in range(6)] == expected


SCRIPT = """
import os, sys
import numba
import numpy as np
from ferguson_gym import fleet
from ferguson_gym.vector_environment import VectorObstacleField

fleet.numba.get_num_threads = lambda: 3
envs = VectorObstacleField(70, fields=20)
envs.reset(seed=0)
still = np.zeros((70, 4), np.float32)

def flown():
    return b"".join(envs.step(still)[0]["vehicle"].tobytes() for _ in range(20))

envs.step(still)
"""
FORK = """
read, write = os.pipe()
if (child := os.fork()) == 0:
    os.write(write, str(hash(flown())).encode())
    os._exit(0)
mine = str(hash(flown())).encode()
assert os.waitpid(child, 0)[1] == 0
assert os.read(read, 100) == mine
print("both flew")
"""


def run(script: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}
    return subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment,
        check=False,
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_child_flies_on_without_the_threads_of_its_parent() -> None:
    done = run(SCRIPT + FORK)
    assert (done.returncode, done.stdout, done.stderr) == (0, "both flew\n", "")


def test_a_program_ends_while_threads_look_for_work() -> None:
    done = run(SCRIPT + "print('flew')")
    assert (done.returncode, done.stdout, done.stderr) == (0, "flew\n", "")
