"""Evaluation: its files, and that they do not depend on the number of workers."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.evaluation.results import FLIGHT_COLUMNS, TIMING_COLUMNS, flight_rows
from agents.evaluation.run import evaluate
from agents.evaluation.statistics import summarise
from agents.flights.flight import fly
from agents.flights.flight_table import table_of
from ferguson_gym.curves.arc_length import length
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.constructors import single_start
from planners.registry import PLANNERS

HEAD_ON = Field(
    name="head-on", obstacles=Obstacles.discs([[5, 0]], [5]), start_derivative=np.array([5, 0])
)
"""No flight leaves it: the start touches a disc and faces its centre."""
FIELDS = [*get_fields("sparse/train:0-2"), *get_fields("paper:4"), HEAD_ON]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("one") / "results"
    evaluate(["single-start"], FIELDS, range(2), directory)
    return directory


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_flights_csv_has_a_row_for_every_policy_field_and_seed(
    run: Path,
) -> None:
    table = rows(run / "flights.csv")
    assert tuple(table[0]) == FLIGHT_COLUMNS
    keys = [(row["policy"], row["field"], row["seed"]) for row in table]
    assert keys == [("single-start", f.name, str(s)) for f in FIELDS for s in range(2)]
    assert "goal_reached" in {row["outcome"] for row in table}
    assert {row["outcome"] for row in table if row["field"] == "head-on"} == {"gave_up"}


def test_rows_agree_with_the_paths(run: Path) -> None:
    paths = np.load(run / "paths.npz")
    table = rows(run / "flights.csv")
    offsets = paths["offsets"]
    assert len(offsets) == len(table) + 1
    assert offsets[-1] == len(paths["control"])
    for k, row in enumerate(table):
        control = paths["control"][offsets[k] : offsets[k + 1]]
        field = next(f for f in FIELDS if f.name == row["field"])
        assert (paths["policy"][k], paths["field"][k], str(paths["seed"][k])) == (
            row["policy"],
            row["field"],
            row["seed"],
        )
        assert int(row["segments"]) == len(control)
        assert float(row["length"]) == pytest.approx(length(control).sum(), rel=1e-12)
        assert is_feasible(control, field).all()
        success = row["outcome"] == "goal_reached"
        assert row["success"] == str(int(success))
        assert success == bool((control[-1:, 1] == field.goal).all(axis=1).any())


def test_gaps_are_given_for_flights_that_arrived(run: Path) -> None:
    for row in rows(run / "flights.csv"):
        field = next(f for f in FIELDS if f.name == row["field"])
        assert float(row["exact_length"]) == exact_length(field) >= field.distance
        assert (row["gap"] == "") == (row["success"] == "0")
        if row["gap"]:
            ratio = float(row["length"]) / float(row["exact_length"])
            assert float(row["gap"]) == ratio - 1.0 >= -1e-6


def test_without_a_shortest_path_there_is_no_gap() -> None:
    # between start and goal a wall from bound to bound
    closed = Field(
        name="closed", obstacles=Obstacles.discs([[50.0, y] for y in range(-10, 111, 5)], [4] * 25)
    )
    flight = replace(fly("single-start", FIELDS[0]), field=closed)
    assert flight.exact_length is None
    assert flight.gap is None
    (row,) = flight_rows(table_of([flight]))
    assert row[6:8] == ("", "")


def test_timings_have_the_same_keys(run: Path) -> None:
    timings = rows(run / "timings.csv")
    assert tuple(timings[0]) == TIMING_COLUMNS
    keys = ("policy", "field", "seed")
    assert [[row[key] for key in keys] for row in timings] == [
        [row[key] for key in keys] for row in rows(run / "flights.csv")
    ]
    for row in timings:
        assert 0.0 <= float(row["decision_seconds_median"]) <= float(row["decision_seconds_max"])
        assert float(row["decision_seconds_max"]) <= float(row["seconds"])


def test_two_workers_write_the_same_flights(run: Path, tmp_path: Path) -> None:
    evaluate(["single-start"], FIELDS, range(2), tmp_path, workers=2)
    assert (tmp_path / "flights.csv").read_bytes() == (run / "flights.csv").read_bytes()
    one, two = np.load(run / "paths.npz"), np.load(tmp_path / "paths.npz")
    for key in one.files:
        np.testing.assert_array_equal(one[key], two[key])


def test_the_summary_says_what_a_policy_knows(run: Path, tmp_path: Path) -> None:
    summary = json.loads((run / "summary.json").read_text())
    assert [one["knows"] for one in summary["statistics"]["policies"]] == ["nearby"]
    assert summarise(run) == summary["statistics"]
    copy = tmp_path / "copy"
    copy.mkdir()
    shutil.copy(run / "flights.csv", copy)  # as of an evaluation that did not record it
    assert [one["knows"] for one in summarise(copy)["policies"]] == ["nearby"]
    summary["statistics"]["policies"][0]["knows"] = "whole field"
    (copy / "summary.json").write_text(json.dumps(summary))
    assert [one["knows"] for one in summarise(copy)["policies"]] == ["whole field"]


def test_pictures_are_written(run: Path) -> None:
    picture = run / "single-start.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in run.iterdir()) == [
        "flights.csv",
        "paths.npz",
        "report.html",
        "single-start.png",
        "summary.json",
        "timings.csv",
    ]


def test_a_policy_that_is_named_by_a_path_has_its_picture_among_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = r"results/ppo\best.zip"
    monkeypatch.setitem(PLANNERS, name, single_start)
    evaluate([name], FIELDS[:1], range(1), tmp_path)
    assert (tmp_path / "results-ppo-best.zip.png").read_bytes().startswith(b"\x89PNG")
    assert "results-ppo-best.zip.png" in capsys.readouterr().err
    assert rows(tmp_path / "flights.csv")[0]["policy"] == name
