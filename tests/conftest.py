"""Fixtures that several files of tests use."""

import gc
import threading
from collections.abc import Callable, Iterator

import pytest

from tests.waiting import until


@pytest.fixture
def started() -> Iterator[Callable[[], list[threading.Thread]]]:
    """Threads alive that a test has started; at its end there must be none."""
    before = set(threading.enumerate())

    def mine() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread not in before]

    yield mine
    gc.collect()
    assert until(lambda: not mine()), mine()
