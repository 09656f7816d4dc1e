"""Agents in evaluations: no flight depends on workers, chunks, or how many fly together."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("sb3_contrib")

from agents.cli.main import main
from agents.evaluation import run, work
from agents.evaluation.request import Request, field_of
from agents.evaluation.work import Work
from agents.flights.flight import fly
from agents.runtime.executors import Backend
from tests.support.small_models import saved

FIELDS = [*(f"sparse/train:{k}" for k in range(7)), "traps/train:0", "paper:2"]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("agents") / "ace")


def contents(directory: Path) -> list[bytes]:
    return [(directory / name).read_bytes() for name in ("flights.csv", "paths.npz")]


def test_flights_are_those_of_the_agent_alone(model: Path, tmp_path: Path) -> None:
    request = Request(policies=[str(model)], fields=FIELDS, seeds=[0])
    run.run(request, tmp_path / "one", Backend())
    one = contents(tmp_path / "one")
    for together, chunk in ((1, 4), (3, 9), (5, 6)):
        out = tmp_path / f"{together}-{chunk}"
        run.run(replace(request, chunk=chunk), out, Backend(), batch=together)
        assert contents(out) == one
    with (tmp_path / "one" / "flights.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    alone = fly(str(model), field_of(FIELDS[-1]), 0)
    assert rows[-1]["length"] == repr(alone.length)
    assert rows[-1]["outcome"] == alone.outcome.label
    with (tmp_path / "one" / "timings.csv").open(newline="") as file:
        times = list(csv.DictReader(file))
    # decided for many flights at once: no decision has a time of its own
    assert {row["decision_seconds_median"] for row in times} == {""}
    assert {row["seconds"] for row in times} == {times[0]["seconds"]}
    summary = json.loads((tmp_path / "one" / "summary.json").read_text())
    (told,) = summary["policies"]
    assert told["timed_flights"] == len(FIELDS)
    assert told["timed_decisions"] > 0
    assert {Path(file).name for file in told["models"]} == {"model.zip", "model.json"}
    assert all(len(digest) == 64 for digest in told["models"].values())


@pytest.mark.slow
def test_flights_do_not_depend_on_workers(model: Path, tmp_path: Path) -> None:
    request = Request(
        policies=[str(model), "guided", f"{model}+shield"], fields=FIELDS, seeds=[0, 1], chunk=7
    )
    for workers in (1, 2, 4):
        run.run(request, tmp_path / str(workers), Backend(workers=workers))
    assert contents(tmp_path / "1") == contents(tmp_path / "2") == contents(tmp_path / "4")


def test_another_model_at_the_same_path_is_another_configuration(tmp_path: Path) -> None:
    place = saved(tmp_path / "ace")
    fields = ["--fields", "sparse/train:0", "--out", str(tmp_path / "out")]
    assert main(["evaluate", "--policy", str(place), *fields]) == 0
    for policy in (str(place), f"{place}+shield", f"single-start+from={place}"):
        before = Request(policies=[policy], fields=["paper:1"], seeds=[0]).configuration
        saved(place, seed=int.from_bytes(policy.encode()[-1:], "big"))
        assert Request(policies=[policy], fields=["paper:1"], seeds=[0]).configuration != before
    request = Request(policies=[str(place)], fields=["sparse/train:0"], seeds=range(1))
    with pytest.raises(ValueError, match=r"another configuration \(policies\."):
        work.is_finished(Work(tmp_path / "out", request))
