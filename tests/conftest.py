"""Fixtures that several files of tests use."""

import gc
import importlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import settings

from tests.fuzz.cases import LARGE
from tests.support.places import ROOT
from tests.support.waiting import until

settings.register_profile("large", max_examples=LARGE)  # `make fuzz`


@pytest.fixture
def started() -> Iterator[Callable[[], list[threading.Thread]]]:
    """Threads alive that a test has started; at its end there must be none."""
    before = set(threading.enumerate())

    def mine() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread not in before]

    yield mine
    gc.collect()
    assert until(lambda: not mine()), mine()


@pytest.fixture(autouse=True, scope="session")
def interrupts_are_heard() -> None:
    """Tests started in the background ignore Ctrl-C, and so do their processes."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    """A script of benchmarks/ by its name, as a module."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module
