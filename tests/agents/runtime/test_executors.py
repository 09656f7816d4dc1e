"""A Dask cluster on this machine, and the errors reported before any work starts."""

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from joblib import delayed

from agents.cli.main import main
from agents.evaluation import run as evaluation
from agents.evaluation.request import Request
from agents.evaluation.work import WORK
from agents.runtime import executors
from agents.runtime.chunk_store import ChunkStore
from agents.runtime.executors import Backend, open_backend, parse_address
from agents.runtime.worker_processes import Call, WorkerDiedError
from tests.support.processes.dask_cluster import cluster, free_port

NAMES = ("flights.csv", "paths.npz")
REQUEST = Request(
    policies=["guided", "single-start"],
    fields=[f"sparse/train:{k}" for k in range(12)],
    seeds=range(1),
    chunk=2,
)


def contents(directory: Path) -> list[bytes]:
    assert not (directory / WORK).exists()
    return [(directory / name).read_bytes() for name in NAMES]


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "TIMEOUT", 60.0)  # the machine may be busy


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_a_dask_cluster_flies_the_same_flights_though_a_worker_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    evaluation.run(REQUEST, tmp_path / "here", Backend())
    keep = ChunkStore.write
    with cluster(tmp_path) as (address, _, worker):
        workers = [worker(), worker()]
        backend = Backend(name="dask", address=address)
        executors.check(backend)
        evaluation.run(REQUEST, tmp_path / "there", backend)
        assert contents(tmp_path / "there") == contents(tmp_path / "here")

        def kill_one(store: ChunkStore, chunk: int, flown: Any) -> None:
            keep(store, chunk, flown)
            workers[0].kill()

        monkeypatch.setattr(ChunkStore, "write", kill_one)
        evaluation.run(REQUEST, tmp_path / "again", backend)
        assert workers[0].poll() is not None
        assert contents(tmp_path / "again") == contents(tmp_path / "here")


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_a_lost_scheduler_is_reported_and_finished_flights_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep = ChunkStore.write
    with cluster(tmp_path) as (address, scheduler, worker):
        worker()

        def kill(store: ChunkStore, chunk: int, flown: Any) -> None:
            keep(store, chunk, flown)
            scheduler.kill()

        with monkeypatch.context() as patch:
            patch.setattr(ChunkStore, "write", kill)
            with pytest.raises(OSError, match=f"lost the dask scheduler at {address}"):
                evaluation.run(REQUEST, tmp_path / "lost", Backend(name="dask", address=address))
    assert list((tmp_path / "lost" / WORK).glob("chunk-*"))
    evaluation.run(REQUEST, tmp_path / "lost", Backend())
    evaluation.run(REQUEST, tmp_path / "here", Backend())
    assert contents(tmp_path / "lost") == contents(tmp_path / "here")


@pytest.mark.slow
def test_a_scheduler_without_workers_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cluster(tmp_path) as (address, _, _):
        monkeypatch.setattr(executors, "TIMEOUT", 2.0)
        with pytest.raises(ConnectionError, match=f"at {address} has no workers; start some"):
            executors.check(Backend(name="dask", address=address))


class Unreadable:
    def __reduce__(self) -> tuple[Any, ...]:
        return int, ("no number",)


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_calls_in_flight_are_bounded_and_failures_are_distinguished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    handed_out, results = [], []

    def calls() -> Iterator[Call]:
        for number in range(40):
            handed_out.append(number)
            yield delayed(divmod)(number, 3)

    with cluster(tmp_path) as (address, _, worker):
        worker()
        with open_backend(Backend(name="dask", address=address)) as run:
            for result in run(calls(), 3):
                results.append(result)
                assert len(handed_out) - len(results) <= 3
            assert sorted(results) == [divmod(number, 3) for number in range(40)]
            with pytest.raises(ZeroDivisionError):
                list(run([delayed(divmod)(1, 0)]))
            with pytest.raises(OSError, match=r"could not start a call .*is the same version"):
                list(run([delayed(repr)(Unreadable())]))
            fatal = delayed(os._exit)(3)
            with pytest.raises(WorkerDiedError, match=f"workers of {address} died") as died:
                list(run([fatal, delayed(divmod)(7, 3)], 1))
            assert died.value.calls == (fatal,)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--backend", "dask"], "--backend dask needs the --address HOST:PORT of its scheduler"),
        (["--backend", "dask", "--address", "here"], "an address is HOST:PORT, for example"),
        (["--backend", "dask", "--address", "a:70000"], "an address is HOST:PORT, for example"),
        (["--backend", "ray"], "unknown backend 'ray'; backends are processes, dask"),
        (["--address", "10.0.0.1:8786"], "is for a cluster: add --backend dask"),
        (
            ["--backend", "dask", "--address", "a:1", "--workers", "2"],
            "--workers 2 is for processes on this machine",
        ),
        (["--batch", "0"], "need an integer >= 1"),
    ],
)
def test_contradictory_arguments_are_reported_in_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    fields = ["--fields", "paper:1", "--out", str(out)]
    assert main(["evaluate", "--policy", "guided", *fields, *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert message in said
    assert not out.exists()


def test_a_scheduler_that_does_not_answer_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    out, address = tmp_path / "out", f"127.0.0.1:{free_port()}"
    fields = ["--fields", "paper:1", "--out", str(out)]
    words = ["--backend", "dask", "--address", address]
    assert main(["evaluate", "--policy", "guided", *fields, *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"no dask scheduler at {address} (" in said
    assert not out.exists()


@pytest.mark.parametrize("banner", [b"", b"SSH-2.0-OpenSSH_9.2\r\n"])
def test_another_server_at_the_address_is_reported(
    banner: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "TIMEOUT", 0.5)

    def greet(listening: socket.socket) -> None:
        calling, _ = listening.accept()
        with calling:
            calling.sendall(banner)
            with suppress(OSError):
                calling.recv(1)  # until the client closes the connection

    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        greeter = threading.Thread(target=greet, args=(listening,), daemon=True)
        greeter.start()
        address = f"127.0.0.1:{listening.getsockname()[1]}"
        with pytest.raises(ConnectionError, match=f"no dask scheduler at {address}"):
            executors.check(Backend(name="dask", address=address))
        greeter.join()


def test_without_its_library_a_backend_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(executors.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ValueError, match=r"--backend dask needs .*: \.venv/bin/pip install"):
        Backend(name="dask", address="127.0.0.1:1")


def test_addresses() -> None:
    assert parse_address("node-7:8786") == ("node-7", 8786)
    assert parse_address("tcp://10.0.0.1:8786") == ("10.0.0.1", 8786)
    assert parse_address("[::1]:8786") == ("::1", 8786)
