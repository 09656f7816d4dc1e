"""Environments and threads: the same results on any number, and nothing left behind."""

import copy
import os
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

from ferguson_gym.runtime.helper_threads import CLAIMED, DONE, add, get, new_counters
from ferguson_gym.simulation import batch_simulator, step_kernel
from ferguson_gym.simulation.batch_simulator import BLOCK
from ferguson_gym.simulation.settings import INFOS
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.places import ROOT
from tests.support.waiting import until

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    """Compile what helpers run, so that no test waits for that."""
    envs = VectorObstacleField(70, fields=1)
    envs.reset(seed=0)
    job = envs._simulator._plain_buffers
    step_kernel.advance(job, new_counters(), step_kernel.FROM_FRONT, 0)


def flown(number: int, seed: int = 0, **arguments: Any) -> bytes:
    """All that an environment returns over many steps."""
    envs = VectorObstacleField(number, autoreset_mode="SameStep", fields=40, **arguments)
    stream = np.random.default_rng(seed)
    everything = [*envs.reset(seed=seed)[0].values()]
    for _ in range(40):
        actions = stream.uniform(-1.0, 1.0, (number, 4)) * stream.choice([0.03, 0.2], (number, 1))
        seen, reward, terminated, truncated, infos = envs.step(actions)
        everything += [*seen.values(), reward, terminated, truncated]
        everything += [infos[key] for key in INFOS]
    return b"".join(np.ascontiguousarray(array).tobytes() for array in everything)


def keep_busy(over: threading.Event) -> None:
    while not over.is_set():
        sum(range(500))


@pytest.mark.parametrize("kind", ["discs", "rays"])
def test_nothing_depends_on_threads(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch_simulator, "MANY", 10**9)
    alone = flown(70, observation=kind)
    monkeypatch.setattr(batch_simulator, "MANY", 2)
    for threads in (1, 2, 3, 4, 9):
        monkeypatch.setattr(
            batch_simulator.numba, "get_num_threads", lambda threads=threads: threads
        )
        assert flown(70, observation=kind) == alone
    over = threading.Event()
    busy = [threading.Thread(target=keep_busy, args=(over,)) for _ in range(3)]
    for thread in busy:
        thread.start()
    try:
        assert flown(70, observation=kind) == alone
    finally:
        over.set()
        for thread in busy:
            thread.join()


def test_helper_threads_start_from_a_number_of_vehicles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch_simulator.numba, "get_num_threads", lambda: 3)
    for number, helpers in ((batch_simulator.MANY - 1, 0), (batch_simulator.MANY, 2)):
        envs = VectorObstacleField(number, fields=8)
        envs.reset(seed=0)
        before = threading.active_count()
        for _ in range(2):
            envs.step(np.zeros((number, 4), np.float32))
            assert threading.active_count() == before + helpers


@pytest.mark.parametrize("wait", [0.0, 0.05])
def test_a_deleted_vector_environment_frees_threads_and_memory(
    wait: float, monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(batch_simulator.numba, "get_num_threads", lambda: 4)
    for _ in range(5):
        envs = VectorObstacleField(70, fields=1)
        envs.reset(seed=0)
        assert not started()
        envs.step(np.zeros((70, 4), np.float32))
        assert len(started()) == 3
        alive = [
            weakref.ref(thing) for thing in (envs._simulator, envs._simulator._buffers.actions)
        ]
        time.sleep(wait)
        del envs
        assert alive[0]() is None
        assert until(lambda: not started())
        assert alive[1]() is None


def test_every_vehicle_is_stepped_once_a_step(
    monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(batch_simulator.numba, "get_num_threads", lambda: 4)
    number = 9 * step_kernel.CHUNK + 3
    envs = VectorObstacleField(number, autoreset_mode="Disabled", fields=1, obstacles=0)
    still = np.zeros((number, 4), np.float32)
    for _ in range(150):
        envs.reset(options={"field": OPEN})
        for flown in range(1, 16):
            *_, infos = envs.step(still)
            assert (infos["segments"] == flown).all()
    assert len(started()) == 3


def test_many_environments_in_many_threads(
    monkeypatch: pytest.MonkeyPatch, started: Callable
) -> None:
    monkeypatch.setattr(batch_simulator.numba, "get_num_threads", lambda: 3)
    expected = [flown(66, seed) for seed in range(6)]
    got: dict[int, bytes] = {}
    threads = [
        threading.Thread(target=lambda seed=seed: got.update({seed: flown(66, seed)}))
        for seed in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [got[seed] for seed in range(6)] == expected


@numba.njit(nogil=True)
def claim(counters: np.ndarray, pieces: int) -> int:
    """Wait for work and claim a piece of it; what is no piece if none came or was left."""
    for _ in range(20_000_000):
        if get(counters, CLAIMED) < pieces:
            return add(counters, CLAIMED, 1)
    return pieces


@numba.njit
def report_done(counters: np.ndarray) -> None:
    add(counters, DONE, 1)


def test_a_step_waits_for_pieces_that_others_have_begun() -> None:
    number = 2048
    pieces = number // step_kernel.CHUNK
    envs = VectorObstacleField(number, autoreset_mode="SameStep", fields=20)
    envs.reset(seed=0)
    job, counters = envs._simulator._plain_buffers, new_counters()
    late, done = [0], new_counters()

    def help_late() -> None:
        if claim(counters, pieces) < pieces:
            time.sleep(0.05)
            late[0] += 1
            report_done(counters)

    claim(np.zeros(2, np.int64), pieces), report_done(done)  # compiled before it matters
    for _ in range(100):
        before, helper = late[0], threading.Thread(target=help_late)
        envs._simulator._draw_ahead(envs._simulator._all, envs._streams)
        helper.start()
        step_kernel.advance(job, counters, step_kernel.FROM_FRONT, 0)
        waited = late[0] > before
        helper.join()
        assert waited == (late[0] > before)
        if late[0] == 3:
            break
    assert late[0] == 3


SCRIPT = """
import os, sys
import numba
import numpy as np
from ferguson_gym.simulation import batch_simulator
from ferguson_gym.vector_environment import VectorObstacleField

batch_simulator.numba.get_num_threads = lambda: 3
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


def test_a_step_interrupted_before_seeds_were_drawn_can_be_repeated() -> None:
    envs = VectorObstacleField(3, fields=50)
    envs.reset(seed=0)
    ends = np.full((3, 4), -1.0, np.float32)
    for _ in range(3):
        envs._simulator._buffers.flights["next"][:] = BLOCK  # all used up, and no more drawn
        envs.step(ends)
        assert (envs._simulator._buffers.flights["next"] <= BLOCK).all()
        assert {envs.field(i).name.partition(":")[0] for i in range(3)} == {"standard/train"}


def test_environments_with_threads_can_be_copied() -> None:
    envs = VectorObstacleField(70, fields=10)
    envs.reset(seed=0)
    actions = np.zeros((70, 4), np.float32)
    envs.step(actions)
    twin = copy.deepcopy(envs)
    for _ in range(5):
        (seen, reward, *_), (other, again, *_) = envs.step(actions), twin.step(actions)
        np.testing.assert_array_equal(reward, again)
        for key in seen:
            np.testing.assert_array_equal(seen[key], other[key])
