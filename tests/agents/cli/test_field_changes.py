"""`--inflate`, `--limit` and the note on touching obstacles: the same fields for all that fly."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from agents.cli.main import main
from agents.evaluation.reading import read
from agents.evaluation.results import read_paths
from ferguson_gym.curves import length
from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world import Field, Obstacles, get_field
from ferguson_gym.world.field import to_json

SLITS = {"centers": [[50, 0.5 * k] for k in range(-20, 221)], "radii": [0.25] * 241}


@pytest.fixture
def slits(tmp_path: Path) -> str:
    """A wall of touching discs between start and goal."""
    path = tmp_path / "slits.json"
    path.write_text(json.dumps(SLITS))
    return str(path)


def test_a_plan_keeps_the_vehicle_clear(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["plan", "paper:2", "--planner", "shortest", "--inflate", "0.5"]
    assert main([*command, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    field = get_field("paper:2")
    assert field.obstacles.clearance(report["control"]).min() >= 0.5 - 1e-5
    assert report["exact_length"] == exact_length(field.inflated(0.5))
    assert (report["field"], report["inflate"]) == ("paper:2", 0.5)
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "shortest on paper:2 with obstacles inflated by 0.5 m, seed 0: found" in out


def test_a_wall_of_touching_discs_is_noted_and_closes(
    slits: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["plan", slits, "--planner", "pursuit", "--no-reference"]
    main(command)
    note = (
        "note: in slits 240 pairs of obstacles touch without overlapping, and paths may pass "
        "between them; --inflate METRES, the vehicle's radius, closes such gaps\n"
    )
    assert note in capsys.readouterr().err
    main([*command, "--quiet"])
    assert "note" not in capsys.readouterr().err
    assert main(["plan", slits, "--planner", "pursuit", "--inflate", "0.1"]) == 1
    out, err = capsys.readouterr()
    assert "no way to the goal exists" in out
    assert "note" not in err


def test_evaluations_with_another_inflation_are_not_mixed(
    slits: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results"
    fields = ["--fields", slits, "--fields", "sparse/train:0-1"]
    command = ["evaluate", "--policy", "pursuit", *fields, "--out", str(out)]
    assert main([*command, "--inflate", "0.3"]) == 0
    printed = capsys.readouterr().out
    assert "for their shortest paths: obstacles inflated by 0.3 m\n" in printed
    assert "slits: no way to the goal exists\n" in printed
    lengths = read(out)["exact_length"]
    drawn = [get_field(f"sparse/train:{k}").inflated(0.3) for k in range(2)]
    np.testing.assert_array_equal(lengths, [np.nan, *map(exact_length, drawn)])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["configuration"]["inflate"] == 0.3
    assert "--inflate 0.3" in summary["command"]
    assert [one["field"] for one in summary["unreachable"]] == ["slits"]

    page = (out / "report.html").read_text()
    radii = drawn[0].obstacles.radii
    assert f",{round(100.0 * radii[-1])}]" in page
    assert "shortest paths: obstacles inflated by 0.3 m." in page

    assert main(command) == 2
    assert "inflate was 0.3, now 0.0" in capsys.readouterr().err
    assert main([*command, "--inflate", "30", "--fresh"]) == 2
    assert "with obstacles inflated by 30 m: start" in capsys.readouterr().err


def test_planners_are_compared_among_inflated_obstacles(
    slits: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["bench", "planners", "--planner", "shortest", "--fields", slits]
    out = str(tmp_path / "results")
    assert main([*command, "--inflate", "0.3", "--out", out]) == 0
    printed = capsys.readouterr().out
    assert "the same 1 fields, obstacles inflated by 0.3 m, their own" in printed
    assert "shortest failed: 1 no_way" in printed


def test_a_plan_within_other_limits(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["plan", "paper:2", "--planner", "shortest"]
    limits = ["--limit", "longest=30", "--limit", "gate=0.5"]
    assert main([*command, *limits, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["limits"] == asdict(get_field("paper:2").with_limits(longest=30, gate=0.5).limits)
    lengths = length(np.array(report["control"]))
    assert 15.0 < lengths.max() <= 30.0 + 2e-5
    assert lengths.min() >= 6.0 - 2e-5
    assert main([*command, *limits]) == 0
    assert "shortest on paper:2 with longest 30 m, gate 0.5 m, seed 0" in capsys.readouterr().out
    assert main([*command, "--limit", "segments=3"]) == 1
    assert "3 segments of at most 15 m fly 45 m" in capsys.readouterr().out
    assert main([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["limits"] == asdict(get_field("paper:2").limits)


def test_an_evaluation_within_other_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results"
    town = tmp_path / "town.json"
    to_json(get_field("sparse/train:7").with_limits(longest=12), town)
    fields = ["--fields", "paper:2", "--fields", "sparse/train:0-1", "--fields", str(town)]
    command = ["evaluate", "--policy", "pursuit", *fields, "--out", str(out)]
    limits = ["--limit", "longest=30", "--limit", "segments=12"]
    assert main([*command, *limits]) == 0
    printed = capsys.readouterr().out
    assert "also for their shortest paths: longest 30 m, segments 12\n" in printed
    assert "Table I" not in printed
    flown = read_paths(out / "paths.npz", 4)
    assert max(length(one).max() for one in flown.control(range(4)).values()) > 13.0  # else 7
    summary = json.loads((out / "summary.json").read_text())
    assert summary["configuration"]["limits"] == {"longest": 30.0, "segments": 12.0}
    assert "--limit longest=30 --limit segments=12" in summary["command"]
    assert main(["evaluate", *summary["command"].split()[2:]]) == 0
    assert "holds these results already" in capsys.readouterr().err
    assert main(command) == 2
    assert "limits.longest was 30.0, now null" in capsys.readouterr().err
    assert main([*command, "--limit", "segments=9", "--fresh"]) == 0
    assert "sparse/train:1: the limits allow no path to the goal" in capsys.readouterr().out


def test_other_commands_within_other_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = ["--limit", "longest=30", "--inflate", "0.1"]
    out = tmp_path / "results"
    command = ["bench", "planners", "--planner", "shortest", "--fields", "sparse/train:0"]
    assert main([*command, *limits, "--out", str(out)]) == 0
    assert ", obstacles inflated by 0.1 m, longest 30 m, their own" in capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["inflate"], summary["limits"]) == (0.1, {"longest": 30.0})
    near = tmp_path / "near.json"  # a short flight has few frames
    to_json(
        Field(name="near", obstacles=Obstacles.discs([[9.0, 14.0]], [2.0]), goal=[26.0, 26.0]), near
    )
    command = ["animate", str(near), "--policy", "shortest", *limits]
    assert main([*command, "--out", str(tmp_path / "flight.gif")]) == 0
    expected = "shortest on near with obstacles inflated by 0.1 m, longest 30 m, seed 0: "
    assert expected in capsys.readouterr().out
