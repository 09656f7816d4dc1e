"""The program `ferguson`: what it prints, writes and returns."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.cli import plan_report
from agents.cli.main import main
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import to_json
from ferguson_gym.world.field_names import get_field
from planners.interface import Route
from planners.registry import make

PROGRAM = Path(sys.executable).with_name("ferguson")

JSON_KEYS = [
    "field",
    "planner",
    "seed",
    "status",
    "success",
    "length",
    "exact_length",
    "gap",
    "clearance",
    "segments",
    "min_turn_radius",
    "step_seconds",
    "wall_seconds",
    "control",
    "message",
    "to_goal",
    "evaluations",
    "inflate",
    "limits",
    "route_length",
]


def test_plan_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["plan", "paper:1", "--planner", "single-start", "--json"]
    main(line)  # the first one may note on standard error that it compiles
    capsys.readouterr()
    status = main(line)
    out, err = capsys.readouterr()
    report = json.loads(out)
    assert status == 0
    assert err == ""
    assert list(report) == JSON_KEYS
    assert report["success"] is True
    assert report["status"] == "solved"
    assert report["gap"] == pytest.approx(report["length"] / 144.845765 - 1.0)
    control = np.array(report["control"])
    assert control.shape == (report["segments"], 4, 2)
    assert is_feasible(control, get_field("paper:1")).all()
    assert len(report["step_seconds"]) == report["segments"]
    assert sum(report["step_seconds"]) <= report["wall_seconds"]


def test_plan_without_a_path_has_nulls_and_status_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = 8.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    path = tmp_path / "ring.json"
    path.write_text(json.dumps({"centers": ring.tolist(), "radii": [1.5] * 24}))
    status = main(["plan", str(path), "--planner", "single-start", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert status == 1
    assert list(report) == JSON_KEYS
    assert report["field"] == "ring"
    assert report["success"] is False
    for key in ("length", "gap", "clearance", "segments", "min_turn_radius", "control"):
        assert report[key] is None


def test_a_plan_with_options_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["plan", "traps/train:0", "--planner", "multi-start", "--json"]
    status = main([*command, "--backtrack", "--sensing-range", "20"])
    report = json.loads(capsys.readouterr().out)
    assert status == 0
    assert report["planner"] == "multi-start+backtrack+sensing=20"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["guided", "--sensing-range", "0"], "a sensing range must be above 0 m, got 0 m"),
        (["guided", "--sensing-range", "14.5"], "segment, 15 m in field paper:1, got 14.5 m"),
        (["guided", "--sensing-range", "far"], "need a number of metres, got 'far'"),
        (["shortest", "--sensing-range", "20"], "'shortest' plans its whole path at once"),
        (["astar", "--backtrack"], "'astar' plans its whole path at once"),
    ],
)
def test_options_that_do_not_fit_are_told_in_one_line(
    capsys: pytest.CaptureFixture[str], options: list[str], told: str
) -> None:
    assert main(["plan", "paper:1", "--planner", *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert err.count("\n") == 1


def test_plan_for_people_with_a_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "flight.svg"
    name = "sparse/train:0"
    assert main(["plan", name, "--planner", "single-start", "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "found a feasible path to the goal" in out
    assert "objective [m]" in out
    assert "converged" in out
    assert "route" not in out
    assert re.search(r"[1-9]\d* function evaluations", out.replace("\n", " "))
    assert "<svg" in picture.read_text()


def test_a_plan_along_a_route_tells_of_the_route(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "paper:1", "--planner", "shortest"]) == 0
    route, status, *facts = capsys.readouterr().out.splitlines()
    told = r"route: 144\.8458 m, 0\.00 % above the shortest path, found after \d+\.\d{3} s"
    assert re.fullmatch(told, route)
    assert status == "shortest on paper:1, seed 0: found a feasible path to the goal"
    assert "% above the shortest path, 144.8458 m" in " ".join(facts)
    assert "evaluations" not in " ".join(facts)


def test_a_route_that_is_not_the_shortest_says_by_how_much() -> None:
    report = plan_report.plan(make("shortest"), "slow", get_field("sparse/train:0"), 0)
    exact = report.flight.exact_length
    assert exact is not None
    route = Route(
        points=np.empty((0, 2)), length=1.5 * exact, progress=[(0.1, 999.0), (2.5, 1.5 * exact)]
    )
    shown = replace(report, plan=replace(report.plan, route=route)).lines()
    told = f"route: {1.5 * exact:.4f} m, 50.00 % above the shortest path, found after 2.500 s"
    assert next(shown) == told


def test_without_a_route_there_is_none_to_tell_of(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    wall = {"centers": [[50, y] for y in range(-10, 111, 5)], "radii": [4] * 25}
    path = tmp_path / "wall.json"
    path.write_text(json.dumps(wall))
    assert main(["plan", str(path), "--planner", "shortest", "--no-reference"]) == 1
    status, facts = capsys.readouterr().out.splitlines()
    assert status == "shortest on wall, seed 0: found no route to the goal"
    assert facts.startswith("0 segments, ")


def test_evaluate_prints_tables_and_writes_results(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "deep" / "results"
    arguments = ["--policy", "single-start", "--fields", "paper:1", "--fields", "paper:4"]
    assert main(["evaluate", *arguments, "--out", str(target)]) == 0
    out = capsys.readouterr().out
    assert "single-start paper:1" in out
    assert "144.85" in out
    assert "(N/A)" in out
    assert (target / "flights.csv").exists()


DISC = {"centers": [[50, 50]], "radii": [4]}


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("paper:7", "the paper has fields 1 to 4, not 7"),
        ("paper:1-4", "names more than one field"),
        ("jungle/train:1", "unknown suite 'jungle'; suites are standard, sparse"),
        ("standard/exam:1", "unknown split 'exam'; splits are train, validation, test"),
        ("standard:1", "unknown field 'standard:1'"),
        ("nowhere.json", "no such field file: 'nowhere.json'"),
        ("nonsense", "unknown field 'nonsense': fields are named paper:1 to paper:4"),
        ({**DISC, "radii": [float("nan")]}, "radii must be finite, got nan"),
        ({**DISC, "radii": [float("inf")]}, "radii must be finite, got inf"),
        ({**DISC, "radii": [-2]}, "radii must be positive, got -2 m"),
        ({**DISC, "radii": [4, 5]}, "1 centers and 2 radii"),
        ({**DISC, "centers": [[50, 50, 50]]}, "obstacles have 3 dimensions, start and goal 2"),
        ({**DISC, "centers": [[1, 1]]}, "start (0, 0) lies 2.59 m inside obstacle 0"),
        ({**DISC, "centers": [[99, 99]]}, "goal (100, 100) lies 2.59 m inside obstacle 0"),
        ({**DISC, "start": [-20, 0]}, "start (-20, 0) lies outside the bounds"),
        ({**DISC, "goal": [0, 0]}, "start and goal coincide"),
        ({"centers": []}, "a field needs radii"),
        ([1, 2], "a field is a JSON object"),
        ({**DISC, "centers": [[5, 5, 5]], "start": [0, 0, 0], "goal": [9, 9, 9]}, "planar"),
        ("{broken", "Expecting property name"),
    ],
)
def test_bad_fields_are_one_line_and_status_two(
    field: object, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    spec = field
    if not isinstance(field, str) or field.startswith("{"):
        path = tmp_path / "field.json"
        path.write_text(field if isinstance(field, str) else json.dumps(field))
        spec = str(path)
    target = tmp_path / "results"
    for command in (
        ["plan", str(spec), "--planner", "single-start"],
        ["evaluate", "--policy", "single-start", "--fields", str(spec), "--out", str(target)],
    ):
        if command[0] == "evaluate" and "more than one" in message:
            continue
        assert main(command) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert err.startswith("ferguson: ")
        assert message in err
        assert not target.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plan", "paper:1", "--planner", "nobody"], "unknown planner 'nobody'"),
        (["plan", "paper:1"], "required: --planner"),
        (["plan", "paper:1", "--planner", "single-start", "--seed", "-1"], "--seed"),
        (["plan", "paper:1", "--planner", "single-start", "--plot", "a.bmp"], ".png, .pdf, .svg"),
        (
            ["plan", "paper:1", "--planner", "single-start", "--plot", "no/a.png"],
            "no such directory",
        ),
        (
            ["plan", "paper:1", "--planner", "single-start", "--seed", str(2**63)],
            "at most 2**63 - 1",
        ),
        (["evaluate", "--policy", "ace", "--fields", "paper:1"], "unknown policy 'ace'"),
        (["evaluate", "--policy", "single-start", "--fields", "paper:4-1"], "empty range"),
        (
            ["evaluate", "--policy", "single-start", "--fields", "paper:1", "--seeds", "3-1"],
            "empty range",
        ),
        (
            ["evaluate", "--policy", "single-start", "--fields", "paper:1", "--workers", "0"],
            "an integer >= 1",
        ),
        (
            ["evaluate", *["--policy", "single-start"] * 2, "--fields", "paper:1"],
            "policy single-start is given twice",
        ),
        (
            ["evaluate", "--policy", "single-start", *["--fields", "paper:1"] * 2],
            "field paper:1 is given twice",
        ),
        (["land"], "invalid choice: 'land'"),
    ],
)
def test_bad_arguments_are_one_line_and_status_two(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "results"
    if arguments[:1] == ["evaluate"]:
        arguments = [*arguments, "--out", str(target)]
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert not target.exists()


def test_a_file_in_the_place_of_results_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("mine")
    for out in ("taken", "taken/deeper"):
        target = str(tmp_path / out)
        arguments = ["evaluate", "--policy", "single-start", "--fields", "paper:1", "--out", target]
        assert main(arguments) == 2
        assert "is a file, not a directory" in capsys.readouterr().err
    assert (tmp_path / "taken").read_text() == "mine"


def test_results_that_cannot_be_written_are_refused_before_the_flights(
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = ["--policy", "single-start", "--fields", "paper:1", "--out", "/proc/none/results"]
    assert main(["evaluate", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "/proc/none" in err


def test_a_directory_in_the_place_of_a_picture_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "flight.png").mkdir()
    target = str(tmp_path / "flight.png")
    assert main(["plan", "paper:1", "--planner", "single-start", "--plot", target]) == 2
    assert "is a directory" in capsys.readouterr().err


def test_odd_names_of_fields_are_shown_as_they_are(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "[red]a$x^$.json"
    to_json(get_field("sparse/train:0"), path)
    picture = tmp_path / ("p" * 240 + ".png")
    command = ["plan", str(path), "--planner", "single-start", "--plot", str(picture)]
    assert main(command) == 0
    assert "[red]a$x^$" in capsys.readouterr().out
    assert picture.exists()
    results = ["--fields", str(path), "--out", str(tmp_path / "results")]
    assert main(["evaluate", "--policy", "single-start", *results]) == 0
    assert (tmp_path / "results" / "single-start.png").exists()


def test_unknown_keys_of_a_field_are_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "town.json"
    to_json(get_field("sparse/train:0"), path)
    path.write_text(json.dumps({**json.loads(path.read_text()), "colour": "red"}))
    command = [PROGRAM, "plan", path, "--planner", "single-start", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["field"] == "town"
    assert done.stderr == f"ferguson: warning: {path}: ignored unknown keys 'colour'\n"


def test_the_program_is_installed_and_runs() -> None:
    done = subprocess.run([PROGRAM, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("ferguson ")
    done = subprocess.run([PROGRAM, "plan", "--help"], capture_output=True, text=True, check=True)
    assert "  ferguson plan paper:2 --planner" in done.stdout


def test_a_path_among_no_obstacles_is_told_without_odd_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "empty.json"
    path.write_text('{"centers": [], "radii": [], "goal": [50, 90]}')
    assert main(["plan", str(path), "--planner", "shortest"]) == 0
    told = capsys.readouterr().out
    assert "no obstacles" in told
    assert " 0.00 % above" in told
    assert "-0.00" not in told
