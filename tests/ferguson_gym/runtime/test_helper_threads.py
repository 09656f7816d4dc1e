"""Threads that help: every piece is done once, and they end when their owner does."""

import threading
import time
from collections.abc import Callable

import numba
import numpy as np
import pytest

from ferguson_gym.runtime.helper_threads import (
    CLAIMED,
    DONE,
    HelperThreads,
    add,
    get,
    new_counters,
    put,
)
from tests.support.waiting import until

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
        threads = HelperThreads(lambda c=counters, t=times: do_pieces(c, t, PATIENT), helpers)
        assert len(started()) >= helpers
        for job in range(1, 101):
            threads.wake()
            do_job(counters, times)
            assert (times == job).all()
        del threads


def test_helpers_alone_finish_the_work_of_every_call(started: Callable) -> None:
    counters, times = new_counters(), np.zeros(500, np.int64)
    threads = HelperThreads(lambda: do_pieces(counters, times, 10), 3)
    for job in range(1, 60):
        if job % 10 == 0:
            time.sleep(0.01)  # they are asleep for sure
        while not all(signal._asleep for signal in threads._signals):
            time.sleep(0.0001)
        set_out(counters)
        threads.wake()
        assert until(lambda: read(counters, DONE) == 500)
        assert (times == job).all()
    assert len(started()) == 3


def test_calls_at_any_moment_are_safe(started: Callable) -> None:
    count = [0]

    def help_out() -> None:
        count[0] += 1

    threads = HelperThreads(help_out, 3)
    for _ in range(20_000):
        threads.wake()
    assert until(lambda: all(signal._asleep for signal in threads._signals))
    before = count[0]
    threads.wake()
    assert until(lambda: count[0] == before + 3)
    assert len(started()) == 3


def test_threads_end_with_their_owner_before_they_were_called(started: Callable) -> None:
    threads = HelperThreads(lambda: None, 2)
    assert len(started()) == 2
    del threads
    assert until(lambda: not started())


def test_threads_end_with_their_owner_in_the_middle_of_work(started: Callable) -> None:
    begun, over = threading.Event(), threading.Event()

    def help_out() -> None:
        begun.set()
        over.wait(20.0)

    threads = HelperThreads(help_out, 2)
    threads.wake()
    assert begun.wait(20.0)
    del threads
    over.set()
    assert until(lambda: not started())
