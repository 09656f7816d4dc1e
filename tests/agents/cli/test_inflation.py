"""`--inflate` and the note on obstacles that touch: the same fields for plans and references."""

import json
from pathlib import Path

import numpy as np
import pytest

from agents.cli.main import main
from agents.evaluation.reading import read
from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world import Discs, get_field

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
    assert "shortest on paper:2 inflated by 0.5 m, seed 0: found" in capsys.readouterr().out


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
    assert "all obstacles are inflated by 0.3 m, for shortest paths, too\n" in printed
    assert "slits: no way to the goal exists\n" in printed
    lengths = read(out)["exact_length"]
    drawn = [get_field(f"sparse/train:{k}").inflated(0.3) for k in range(2)]
    np.testing.assert_array_equal(lengths, [np.nan, *map(exact_length, drawn)])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["configuration"]["inflate"] == 0.3
    assert "--inflate 0.3" in summary["command"]
    assert [one["field"] for one in summary["unreachable"]] == ["slits"]

    page = (out / "report.html").read_text()
    radii = drawn[0].obstacles.radii if isinstance(drawn[0].obstacles, Discs) else np.empty(0)
    assert f",{round(100.0 * radii[-1])}]" in page

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
