"""A Dask cluster on loopback, of processes that end with the test."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from agents.runtime.executors import parse_address
from tests.support.places import ROOT

Start = Callable[[], subprocess.Popen[bytes]]


def free_port() -> int:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return int(listening.getsockname()[1])


@contextmanager
def process(place: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    with (place / f"{words[0]}.log").open("ab") as log:
        command = [sys.executable, "-m", *words]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        run = subprocess.Popen(command, stdout=log, stderr=log, cwd=place, env=environment)
    try:
        yield run
    finally:
        run.kill()
        run.wait()


@contextmanager
def cluster(place: Path) -> Iterator[tuple[str, subprocess.Popen[bytes], Start]]:
    """Address and process of a scheduler on loopback, and what starts a worker of it."""
    pytest.importorskip("distributed")
    address = f"127.0.0.1:{free_port()}"
    quiet = ("--host", "127.0.0.1", "--no-dashboard")
    with ExitStack() as stack:
        words = ("distributed.cli.dask_scheduler", *quiet, "--port", address.rpartition(":")[2])
        scheduler = stack.enter_context(process(place, *words))

        def worker() -> subprocess.Popen[bytes]:
            words = ("distributed.cli.dask_worker", address, *quiet, "--no-nanny")
            more = ("--nthreads", "2", "--local-directory", str(place))
            return stack.enter_context(process(place, *words, *more))

        end = time.monotonic() + 60.0
        while True:
            try:
                socket.create_connection(parse_address(address), timeout=1.0).close()
                break
            except OSError:
                assert scheduler.poll() is None
                assert time.monotonic() < end
                time.sleep(0.1)
        yield address, scheduler, worker
