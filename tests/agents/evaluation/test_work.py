"""Evaluations in chunks: interrupted, resumed, cut otherwise, they give the same files."""

import itertools
import json
import math
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.evaluation import chunks
from agents.evaluation import run as evaluation
from agents.evaluation import work as evaluation_work
from agents.evaluation.chunks import Result, Task, fly_task
from agents.evaluation.request import Request, field_of, name_of, spans
from agents.evaluation.timing import Timing
from agents.evaluation.work import WORK, Work
from agents.flights.flight import fly
from agents.flights.flight_table import SHIELD, Columns, check, columns_of, drawable, join
from agents.runtime import chunk_store
from agents.runtime.chunk_store import ChunkStore
from agents.runtime.executors import Backend
from agents.runtime.worker_processes import Call, WorkerDiedError
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.outcome import Outcome

ALONE = Backend()
ENDS = (Outcome.GOAL_REACHED, Outcome.COLLISION, Outcome.GAVE_UP)
REQUEST = Request(
    policies=["guided", "single-start+shield"],
    fields=[f"sparse/train:{k}" for k in range(7)],
    seeds=range(3),
    chunk=4,
)


def stub(policy: str, field: str, seed: int) -> Columns:
    """One flight of random values, the same at each call."""
    stream = np.random.default_rng(zlib.crc32(f"{policy} {field} {seed}".encode()))
    segments, windows = int(stream.integers(1, 6)), (1, 3) if seed == 0 else ()
    outcome = ENDS[stream.integers(3)]
    numbers: dict[str, Any] = {
        "outcome": np.int8(outcome.code),
        "from_paper": False,
        "length": stream.uniform(100, 200),
        "exact_length": math.nan if seed == 2 else stream.uniform(90, 100),
        "gap": stream.uniform() if outcome.success and seed != 2 else math.nan,
        "clearance": stream.normal(),
        "segments": segments,
        "min_turn_radius": stream.uniform(1, 9) if seed else math.inf,
        "seconds": 1.0,
        "decision_seconds_median": 0.25,
        "decision_seconds_max": 0.5,
        "evaluations": int(stream.integers(1000)),
        "shield_steps": stream.integers(0, 9, len(SHIELD)).astype(np.int32),
        "refused": stream.normal(size=(4, 2)),
        "window_counts": len(windows),
    }
    return {
        **{name: np.array([value]) for name, value in numbers.items()},
        "window_segments": np.array(windows, np.int64),
        "windows": stream.normal(size=(sum(windows), 4, 2)),
        "control": stream.normal(size=(segments, 4, 2)),
    }


def stubs(task: Task) -> Columns:
    return join([stub(task.policy, name_of(source), seed) for source, seed in task.flights])


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "_fly", stubs)
    monkeypatch.setattr(evaluation, "draw_flights", lambda _, path, title: path.touch())
    monkeypatch.setattr(evaluation, "draw_comparison", lambda _, path: path.touch())
    monkeypatch.setattr(
        evaluation,
        "measure",
        lambda _, policy: Timing(policy=policy, decisions=[1.0], flights=[1.0]),
    )


def contents(directory: Path) -> dict[str, bytes]:
    """What no clock decides; there must be nothing but results."""
    assert not (directory / WORK).exists()
    assert not [path.name for path in directory.iterdir() if path.name.startswith(".")]
    return {name: (directory / name).read_bytes() for name in ("flights.csv", "paths.npz")}


@pytest.fixture
def whole(stubbed: None, tmp_path: Path) -> dict[str, bytes]:
    """Of an evaluation that nothing interrupted."""
    evaluation.run(REQUEST, tmp_path / "whole", ALONE)
    return contents(tmp_path / "whole")


def test_columns_hold_what_pictures_show_of_flights() -> None:
    field = get_field("sparse/train:0")
    flights = [fly(policy, field) for policy in ("guided", "pursuit")]
    columns = join([columns_of([flight], [True]) for flight in flights])
    check(columns, 2)
    for k, flight in enumerate(flights):
        found = drawable(columns, k, flight.policy, field, 0)
        assert np.array_equal(found.control, flight.control)
        assert (found.outcome, found.refused, found.gap) == (flight.outcome, None, flight.gap)
        chains = [one.chain for one in flight.decisions if one.report.starts > 0]
        assert [one.chain.tolist() for one in found.decisions] == [c.tolist() for c in chains]


def test_flights_are_in_order_whatever_the_chunks(whole: dict[str, bytes], tmp_path: Path) -> None:
    rows = whole["flights.csv"].decode().splitlines()[1:]
    keys = itertools.product(REQUEST.policies, REQUEST.fields, REQUEST.seeds)
    assert [row.split(",")[:3] for row in rows] == [[p, name_of(f), str(s)] for p, f, s in keys]
    for size in (1, 3, 7, 1000, None):
        directory = tmp_path / str(size)
        evaluation.run(replace(REQUEST, chunk=size), directory, ALONE)
        assert contents(directory) == whole


def test_stopped_after_any_chunk_it_goes_on_to_the_same_files(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "results"
    keep, flown = ChunkStore.write, []

    def stop(store: ChunkStore, chunk: int, pack: Any) -> None:
        keep(store, chunk, pack)
        flown.append(chunk)
        raise KeyboardInterrupt

    monkeypatch.setattr(ChunkStore, "write", stop)
    for _ in REQUEST.chunks:
        with pytest.raises(KeyboardInterrupt):
            evaluation.run(REQUEST, directory, ALONE)
        assert [path.name for path in directory.iterdir()] == [WORK]
    assert flown == list(range(len(REQUEST.chunks)))
    # stopped while results are written, too
    with monkeypatch.context() as patch:
        patch.setattr(evaluation, "draw_flights", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            evaluation.run(REQUEST, directory, ALONE)
    assert [path.name for path in directory.iterdir()] == [WORK]
    evaluation.run(REQUEST, directory, ALONE)
    assert contents(directory) == whole


def dying(dies: Callable[[list[str]], bool]) -> Callable[[Backend], Any]:
    """A backend whose workers always die with some tasks, told by the fields in them."""

    @contextmanager
    def flying(_: Backend) -> Iterator[Any]:
        def run(calls: Iterator[Call], ahead: int | None = None) -> Iterator[Result]:
            calls = iter(calls)
            while held := list(itertools.islice(calls, ahead or 3)):
                for _, (task,), _ in held:
                    if dies([name_of(source) for source, _ in task.flights]):
                        raise WorkerDiedError("died", held)
                    yield fly_task(task)

        yield run

    return flying


def test_chunks_whose_workers_die_are_flown_flight_by_flight(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = np.random.default_rng(0)
    deaths: list[list[str]] = []

    def dies(names: list[str]) -> bool:
        if dead := len(names) > 1 and stream.random() < 0.4:
            deaths.append(names)
        return bool(dead)

    monkeypatch.setattr(evaluation_work, "open_backend", dying(dies))
    evaluation.run(REQUEST, tmp_path / "results", ALONE)
    assert contents(tmp_path / "results") == whole
    assert len(deaths) > 1


@pytest.mark.usefixtures("stubbed")
def test_a_flight_that_always_ends_its_worker_is_named_and_the_others_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = replace(REQUEST, seeds=[5])
    monkeypatch.setattr(
        evaluation_work, "open_backend", dying(lambda names: "sparse/train:2" in names)
    )
    told = "workers died every time that guided flew the field sparse/train:2, seed 5"
    with pytest.raises(ChildProcessError, match=told):
        evaluation.run(request, tmp_path, ALONE)
    kept = len(list((tmp_path / WORK).glob("chunk-*")))
    assert kept == len(request.chunks) - len(request.policies)


@pytest.mark.usefixtures("stubbed")
def test_another_configuration_is_refused_and_fresh_starts_over(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished, stopped = tmp_path / "whole", tmp_path / "stopped"
    with monkeypatch.context() as patch:
        patch.setattr(ChunkStore, "write", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            evaluation.run(REQUEST, stopped, ALONE)
    software = {**REQUEST.software, "commit": "another"}
    others = [
        ("policies", replace(REQUEST, policies=["guided"])),
        ("fields", replace(REQUEST, fields=["paper:1"])),
        ("seeds", replace(REQUEST, seeds=range(2))),
        ("chunk", replace(REQUEST, chunk=5)),
        ("commit", replace(REQUEST, software=software)),
    ]
    for directory in (finished, stopped):
        for key, other in others:
            with pytest.raises(ValueError, match=rf"configuration \({key}\b.* was .*fresh"):
                evaluation_work.is_finished(Work(directory, other))
    assert evaluation_work.is_finished(Work(finished, REQUEST))
    assert not evaluation_work.is_finished(Work(stopped, REQUEST))
    (finished / "guided.png").rename(finished / "mine.png")
    evaluation.run(replace(REQUEST, policies=["guided"]), finished, ALONE, fresh=True)
    names = {path.name for path in finished.iterdir()}
    assert names == {
        "flights.csv",
        "guided.png",
        "mine.png",
        "paths.npz",
        "report.html",
        "summary.json",
        "timings.csv",
    }
    (finished / "summary.json").unlink()
    with pytest.raises(ValueError, match="does not say how it was made"):
        evaluation_work.is_finished(Work(finished, REQUEST))


@pytest.mark.usefixtures("stubbed")
def test_results_that_are_there_are_not_flown_again(
    whole: dict[str, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(chunks, "_fly", lambda *_: 1 / 0)
    evaluation.run(REQUEST, tmp_path / "whole", ALONE)
    assert "holds these results already; --fresh flies again" in capsys.readouterr().err
    assert contents(tmp_path / "whole") == whole
    with pytest.raises(ZeroDivisionError):
        evaluation.run(REQUEST, tmp_path / "whole", ALONE, fresh=True)


@pytest.mark.usefixtures("stubbed")
def test_killed_while_it_clears_up_the_results_are_there(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "results"
    with monkeypatch.context() as patch:
        patch.setattr(chunk_store.shutil, "rmtree", lambda place, **_: place.exists() and 1 / 0)
        with pytest.raises(ZeroDivisionError):
            evaluation.run(REQUEST, directory, ALONE)
    assert evaluation_work.is_finished(Work(directory, REQUEST))
    evaluation.run(REQUEST, directory, ALONE)
    assert contents(directory) == whole


@pytest.mark.usefixtures("stubbed")
def test_a_damaged_chunk_is_told(tmp_path: Path) -> None:
    work = Work(tmp_path, REQUEST)
    work.begin()
    work.store.file(3).write_bytes(b"PK")
    with pytest.raises(OSError, match=r"chunk-[0-9a-f]{12}-0000003\.npz is damaged .*: remove it"):
        evaluation.run(REQUEST, tmp_path, ALONE)


@pytest.mark.usefixtures("stubbed")
@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"versions": {"numpy": "1.0"}}, "a worker has other versions, .*numpy 1.0, not 2"),
        ({"models": ["abc"]}, "the model of guided differs on a worker"),
    ],
)
def test_workers_of_other_software_are_refused(
    entries: dict[str, Any], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def flying(_: Backend) -> Iterator[Any]:
        yield lambda calls: (replace(fly_task(*given), **entries) for _, given, _ in calls)

    monkeypatch.setattr(evaluation_work, "open_backend", flying)
    with pytest.raises(OSError, match=told):
        evaluation.run(REQUEST, tmp_path, ALONE)


def test_names_that_count_on_are_told_together() -> None:
    names = [*(f"paper:{k}" for k in range(1, 5)), "town", "a:7", "a:8", "a:6", "b:07"]
    assert spans(names) == ["paper:1-4", "town", "a:7-8", "a:6", "b:07"]
    assert spans([":0", ":1", ":5"]) == ["0-1", "5"]


def test_a_field_in_a_file_is_another_when_it_changes() -> None:
    fields = list(get_fields("sparse/train:0-1"))
    named = [replace(field, name="town") for field in fields]
    requests = [Request(policies=["guided"], fields=[field], seeds=[0]) for field in named]
    assert requests[0].configuration != requests[1].configuration
    again = Request(policies=["guided"], fields=[replace(named[0])], seeds=[0])
    assert again.configuration == requests[0].configuration
    short = named[0].with_limits(segments=9)
    shorter = Request(policies=["guided"], fields=[short], seeds=[0])
    assert shorter.configuration != requests[0].configuration
    assert field_of("sparse/train:1").obstacles.centers.tolist() == (  # type: ignore[attr-defined]
        get_field("sparse/train:1").obstacles.centers.tolist()  # type: ignore[attr-defined]
    )
    with pytest.raises(ValueError, match="nothing to fly: no fields"):
        Request(policies=["guided"], fields=[], seeds=[0])


@pytest.mark.slow
@pytest.mark.usefixtures("stubbed")
def test_memory_stays_flat_over_100_000_flights(tmp_path: Path) -> None:
    request = Request(
        policies=["guided"], fields=[f"standard/test:{k}" for k in range(100_000)], seeds=[0]
    )
    tracemalloc.start()
    try:
        evaluation.run(request, tmp_path, ALONE)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 200e6
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["flights"] == 100_000
    with (tmp_path / "flights.csv").open() as file:
        assert sum(1 for _ in file) == 100_001
