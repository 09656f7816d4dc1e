"""`ferguson plan`: the path as a file, and what a plan is compared with."""

import csv
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.cli.main import main
from agents.flights import flight
from agents.policies.warm_up import warm
from ferguson_gym.curves import Path as Curve
from ferguson_gym.world import Field
from planners import Decision, reachability
from planners.receding_horizon import Pursuit

PLAN = ["plan", "sparse/train:0", "--planner", "shortest"]


def test_a_path_is_written_as_csv_and_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, document = tmp_path / "path.csv", tmp_path / "path.JSON"
    assert main([*PLAN, "--out", str(table), "--spacing", "2.5", "--json"]) == 0
    out, err = capsys.readouterr()
    report = json.loads(out)
    with table.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == ["distance", "x", "y", "heading", "curvature"]
    assert err.endswith(f"wrote {len(rows)} points to {table}\n")
    path = Curve(report["control"])
    samples = path.sample(spacing=2.5)
    columns = np.column_stack(
        [samples.distance, samples.position, samples.heading, samples.curvature]
    )
    np.testing.assert_array_equal(np.array(rows, dtype=np.float64), columns)
    np.testing.assert_array_equal(columns[[0, -1], 1:3], [[0.0, 0.0], [100.0, 100.0]])
    assert np.diff(columns[:, 0]).max() <= 2.5

    assert main([*PLAN, "--out", str(document)]) == 0
    data = json.loads(document.read_text(encoding="utf-8"))
    assert list(data) == [*header, "control"]
    np.testing.assert_array_equal(data["x"], path.sample(spacing=0.5).position[:, 0])
    np.testing.assert_array_equal(Curve.load(document).control, path.control)


def test_without_a_path_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wall, out = tmp_path / "wall.json", tmp_path / "path.csv"
    wall.write_text(
        json.dumps({"centers": [[50, y] for y in range(-10, 111, 5)], "radii": [4] * 25})
    )
    out.write_text("older")
    assert main(["plan", str(wall), "--planner", "shortest", "--out", str(out)]) == 1
    assert capsys.readouterr().err.endswith(f"no path, so nothing is written to {out}\n")
    assert out.read_text() == "older"


def refuse(field: Field) -> None:
    pytest.fail(f"the exact length of {field.name} is computed")


def test_without_a_reference_no_exact_length_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [*PLAN, "--no-reference", "--plot", str(tmp_path / "flight.svg")]
    warm("shortest")
    monkeypatch.setattr(flight, "reference_length", refuse)
    monkeypatch.setattr(reachability, "exact_length", refuse)
    assert main([*command, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["exact_length"] is None
    assert report["gap"] is None
    assert report["length"] > 141.0
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "found a feasible path" in out
    assert "shortest path" not in out


def test_what_no_planner_could_reach_is_said_before_planning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wall = tmp_path / "wall.json"
    wall.write_text(
        json.dumps({"centers": [[50, y] for y in range(-10, 111, 5)], "radii": [4] * 25})
    )
    command = ["plan", str(wall), "--planner", "pursuit"]
    assert main([*command, "--no-reference"]) == 1
    assert "found no feasible chain" in capsys.readouterr().out
    monkeypatch.setattr(Pursuit, "plan", pytest.fail)
    assert main([*command, "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert (report["status"], report["message"]) == ("no_way", "no way to the goal exists")
    assert report["control"] is report["length"] is report["segments"] is None
    assert main(command) == 1
    out = capsys.readouterr().out
    assert out.startswith("pursuit on wall, seed 0: no way to the goal exists\n0 segments, ")


def test_a_failed_plan_is_reported_with_its_cause_and_the_path_before_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    touching = tmp_path / "touching.json"
    touching.write_text(json.dumps({"centers": [[3, 3]], "radii": [18**0.5]}))
    command = ["plan", str(touching), "--planner", "single-start"]
    assert main(command) == 1
    assert "; the start touches obstacle 0, and the start derivative" in capsys.readouterr().out
    assert main([*command, "--json"]) == 1
    assert "the start touches obstacle 0" in json.loads(capsys.readouterr().out)["message"]

    command = ["plan", "traps/train:1", "--planner", "single-start"]
    assert main([*command, "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    path = Curve(report["control"])
    assert (report["success"], report["segments"]) == (False, len(path.control))
    assert report["length"] == path.length
    assert report["gap"] is None
    np.testing.assert_allclose(report["to_goal"], np.linalg.norm(path.control[-1, 1] - 100.0))
    assert main(command) == 1
    facts = f"{report['length']:.4f} m, ends {report['to_goal']:.4f} m from the goal, clearance"
    assert facts in capsys.readouterr().out


def test_a_deadline_leaves_the_path_so_far(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    warm("pursuit")
    decide = Pursuit.decide

    def slow(*arguments: Any) -> Decision:
        time.sleep(0.5)
        return decide(*arguments)

    out = tmp_path / "path.json"
    command = ["plan", "dense/train:1", "--planner", "pursuit", "--out", str(out)]
    assert main([*command, "--deadline", "1e-9"]) == 1
    printed, err = capsys.readouterr()
    assert "ran out of time before the goal, after 1e-09 s\n0 segments, " in printed
    assert err.endswith(f"no path, so nothing is written to {out}\n")
    # one decision is made, and the rest of it is flown
    with monkeypatch.context() as patched:
        patched.setattr(Pursuit, "decide", slow)
        assert main([*command, "--deadline", "0.5", "--json"]) == 1
    printed, err = capsys.readouterr()
    report = json.loads(printed)
    assert (report["status"], report["success"]) == ("out_of_time", False)
    assert report["segments"] == 2
    assert " points of the path so far to " in err
    np.testing.assert_array_equal(Curve.load(out).control, report["control"])
    assert main([*command, "--deadline", "1000"]) == 0
    assert main(["plan", "paper:1", "--planner", "voronoi", "--deadline", "1"]) == 2
    assert "planner voronoi cannot stop at a deadline; planners that" in capsys.readouterr().err


def test_a_start_next_to_the_goal_has_no_gap(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    near = tmp_path / "near.json"
    near.write_text(json.dumps({"centers": [], "radii": [], "goal": [1e-9, 0.0]}))
    command = ["plan", str(near), "--planner", "shortest"]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "1 segment, 3.0000 m, no obstacles" in out
    assert "above the shortest path" not in out
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["gap"] is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "path.txt"], "paths are written as .csv, .json, not 'path.txt'"),
        (["--out", "nowhere/path.csv"], "no such directory for the path: nowhere"),
        (["--spacing", "2"], "--spacing 2 is for --out FILE, which is missing"),
        (["--out", "path.csv", "--spacing", "1e-9"], "may give more than 1000000 points; from"),
        (["--out", "path.csv", "--spacing", "0"], "need a positive number of metres, got '0'"),
    ],
)
def test_files_that_cannot_be_written_are_refused_before_planning(
    options: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*PLAN, *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
