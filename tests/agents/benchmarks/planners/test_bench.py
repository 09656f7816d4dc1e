"""`ferguson bench planners`: what is measured, written, printed and refused."""

import csv
import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from agents.benchmarks.planners import styles
from agents.benchmarks.planners.bench import COLUMNS, statistics
from agents.benchmarks.planners.plots import LEAST_GAP, draw, median_progress
from agents.benchmarks.planners.runs import FALSE_SUCCESS, Run, certified, measure, run, runs
from agents.cli.main import main
from ferguson_gym.curves.arc_length import length
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Plan, Route, Seconds, State, initial_state
from planners.registry import PLANNERS, make
from planners.whole_path.planner import with_seconds
from tests.support.stub_planners import STUBS, Faulty

BENCH = ["bench", "planners", "--fields", "sparse/train:0-1"]
FIELD = get_field("sparse/train:0")
CRASHED = STUBS["crashing"]().plan(FIELD, initial_state(FIELD), 0)
NAMES = ["shortest", "multi-start", *STUBS]


@pytest.fixture(autouse=True)
def _with_stubs(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, stub in STUBS.items():
        monkeypatch.setitem(PLANNERS, name, stub)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where one comparison of all was written; what it printed lies beside."""
    out = tmp_path_factory.mktemp("bench") / "deep" / "results"
    with pytest.MonkeyPatch.context() as monkeypatch:
        for name, stub in STUBS.items():
            monkeypatch.setitem(PLANNERS, name, stub)
        chosen = [word for name in NAMES for word in ("--planner", name)]
        assert main([*BENCH, *chosen, "--out", str(out)]) == 0
    return out


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_planner_has_a_row_for_every_field(results: Path) -> None:
    table = rows(results / "planners.csv")
    assert tuple(table[0]) == COLUMNS
    assert [(row["field"], row["planner"]) for row in table] == [
        (f"sparse/train:{k}", name) for k in range(2) for name in NAMES
    ]
    by_name = {row["planner"]: row for row in table}
    assert {name: row["status"] for name, row in by_name.items()} == {
        "shortest": "solved",
        "multi-start": "solved",
        "searching": "solved",
        "without": "no_route",
        "crashing": "crashed",
        "lying": FALSE_SUCCESS,
    }
    for row in table:
        assert float(row["exact_length"]) == exact_length(get_field(row["field"]))
        assert float(row["seconds"]) >= 0.0
        if row["success"] == "0":
            assert not row["length"]
            assert not row["gap"]
            assert not row["min_turn_radius"]
            continue
        assert float(row["gap"]) == float(row["length"]) / float(row["exact_length"]) - 1.0 >= -1e-6
        assert float(row["clearance"]) >= -1e-5
        assert 10 <= int(row["segments"]) <= 40
        speed, radius = float(row["max_turn_speed"]), float(row["min_turn_radius"])
        assert speed**2 == pytest.approx(radius * 9.81 * 3.0**0.5, rel=1e-12)
        assert float(row["bending"]) > 0.0


def test_routes_are_told_before_and_paths_after_the_fit(results: Path) -> None:
    for row in rows(results / "planners.csv"):
        if row["planner"] in ("shortest", "searching"):
            assert float(row["raw_gap"]) == 0.0 < float(row["gap"])
            assert 0.0 < float(row["seconds_first"]) < float(row["seconds"])
        if row["planner"] == "multi-start":
            assert not row["raw_length"]
            assert row["seconds_first"] == row["seconds"]
            assert int(row["evaluations"]) > 100


def test_the_summary_counts_failures(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    assert summary["fields"] == ["sparse/train:0", "sparse/train:1"]
    assert summary["workers"] == 1
    for library in ("numpy", "networkx", "ompl", "pygmo"):
        installed = importlib.util.find_spec(library) is not None
        assert (library in summary["versions"]) == installed
    told = {one["planner"]: one for one in summary["planners"]}
    assert list(told) == NAMES
    assert {name for name, one in told.items() if one["knows"] == "nearby"} == {"multi-start"}
    assert told["shortest"]["knows"] == "whole field"
    assert told["lying"]["failures"] == {FALSE_SUCCESS: 2}
    assert told["crashing"]["failures"] == {"crashed (gone)": 2}
    assert told["without"]["successes"] == 0
    assert told["without"]["gap_median"] is None
    assert told["without"]["seconds_first_median"] is None
    assert told["shortest"]["successes"] == 2
    assert told["shortest"]["success_low"] == pytest.approx(2 / (2 + 1.959964**2), rel=1e-6)


def test_files_are_written_and_nothing_else(results: Path) -> None:
    assert sorted(path.name for path in results.iterdir()) == [
        "paths.png",
        "planners.csv",
        "planners.log",
        "profiles.png",
        "progress.png",
        "summary.json",
    ]
    for name in ("paths", "progress", "profiles"):
        assert (results / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_table_says_how_failures_count(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    chosen = ["--planner", "single-start", "--planner", "shortest", "--planner", "lying"]
    assert main([*BENCH, *chosen, "--seconds", "0.5", "--out", str(tmp_path)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "Planners on the same 2 fields, 0.5 s where a planner searches on" in printed
    assert "whole field: shortest 2/2 34.2 to 100.0 0 0.00" in printed
    assert re.search(r" nearby: single-start \d/2 ", printed)
    assert printed.index("whole field:") < printed.index("nearby:")
    assert "lying 0/2 0.0 to 65.8 2 - - - - -" in printed
    assert "over successes alone, so a planner that fails on hard fields looks better" in printed
    assert "lying failed: 2 false_success" in printed


def test_planners_that_are_not_installed_are_left_out_or_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def absent() -> None:
        raise ValueError("far needs far-lib: pip install far-lib")

    few = {"without": STUBS["without"], "far": absent}
    with patch.dict(PLANNERS, few, clear=True):  # which, restored, has the order that it had
        leaves_out_or_refuses(tmp_path, capsys)


def leaves_out_or_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*BENCH, "--out", str(tmp_path / "all")]) == 0
    printed = capsys.readouterr().err
    assert "left out far: far needs far-lib: pip install far-lib\n" in printed
    assert {row["planner"] for row in rows(tmp_path / "all" / "planners.csv")} == {"without"}
    summary = json.loads((tmp_path / "all" / "summary.json").read_text())
    assert list(summary["left_out"]) == ["far"]
    assert main([*BENCH, "--planner", "far", "--out", str(tmp_path / "one")]) == 2
    assert "pip install far-lib" in capsys.readouterr().err
    assert not (tmp_path / "one").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "planners"], "required: --fields"),
        ([*BENCH[:-1], "nowhere"], "unknown field 'nowhere'"),
        ([*BENCH, "--fields", "sparse/train:1"], "field sparse/train:1 is given twice"),
        ([*BENCH, "--planner", "kite"], "unknown planner 'kite'"),
        ([*BENCH, "--planner", "shortest", "--planner", "shortest"], "shortest is given twice"),
        ([*BENCH, "--seconds", "0"], "need a positive number of seconds"),
        ([*BENCH, "--workers", "0"], "an integer >= 1"),
        ([*BENCH, "--solvers"], "--solvers"),
    ],
)
def test_bad_arguments_are_one_line_and_status_two(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "results"
    assert main([*arguments, "--out", str(target)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert not target.exists()


def test_a_mistake_in_a_planner_is_told_with_planner_and_field(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(PLANNERS, "faulty", Faulty)
    with pytest.raises(TypeError, match="no such thing") as caught:
        list(runs(["faulty"], None, list(get_fields("sparse/train:0-1")), [7], 1))
    assert caught.value.__notes__ == ["while faulty planned the field sparse/train:1 with seed 7"]


def test_every_run_has_a_field_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a planner remembers of a field would not be timed again."""
    met: list[Field] = []

    class Watching:
        def plan(self, field: Field, state: State, seed: int) -> Plan:
            met.append(field)
            return make("without").plan(field, state, seed)

    monkeypatch.setitem(PLANNERS, "watching", Watching)
    few = list(runs(["watching"], None, [FIELD], [0, 1], 1))
    first, second = met[-2:]
    assert first is not second
    for field in (first, second):
        np.testing.assert_array_equal(field.departure, FIELD.departure)
        assert exact_length(field) == few[0].exact_length == exact_length(FIELD)


def test_two_workers_find_the_same_paths() -> None:
    fields = list(get_fields("sparse/train:0-1"))
    alone, together = (
        list(runs(["shortest", "multi-start"], None, fields, [0], workers)) for workers in (1, 2)
    )
    for a, b in zip(alone, together, strict=True):
        assert (a.planner, a.field.name, a.length) == (b.planner, b.field.name, b.length)
        np.testing.assert_array_equal(a.control, b.control)


def spoiled(control: np.ndarray, row: int) -> np.ndarray:
    """A path whose last segment but one is moved by a millimetre at one of its rows."""
    other = control.copy()
    other[-2, row, 0] += 1e-3
    return other


def test_the_benchmarks_own_test_of_a_path() -> None:
    control = make("shortest").plan(FIELD, initial_state(FIELD), 0).control
    assert certified(control, FIELD)
    assert not certified(control[1:], FIELD)
    assert not certified(control[:-1], FIELD)
    assert not certified(np.empty((0, 4, 2)), FIELD)
    for row in range(4):
        assert not certified(spoiled(control, row), FIELD)
    turned = control.copy()
    turned[0, 2] *= 1.01
    assert not certified(turned, FIELD)
    # a disc in the middle of a segment, where it was clear
    middle = control[4, :2].mean(axis=0)
    assert FIELD.obstacles.are_discs
    blocked = Field(
        name="blocked",
        obstacles=Obstacles.discs(
            np.vstack([FIELD.obstacles.centers, middle]), np.append(FIELD.obstacles.radii, 1.0)
        ),
    )
    assert not certified(control, blocked)


def test_a_path_shorter_than_the_shortest_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = make("shortest").plan(FIELD, initial_state(FIELD), 0)
    assert measure("shortest", FIELD, 0, plan, 1.0).success
    monkeypatch.setattr("agents.benchmarks.planners.runs.exact_length", lambda field: 200.0)
    assert measure("shortest", FIELD, 0, plan, 1.0).status == FALSE_SUCCESS


def test_seconds_are_given_to_planners_with_a_budget() -> None:
    searching = with_seconds(make("searching"), 0.25)
    assert searching.router.budget == Seconds(0.25)
    assert with_seconds(make("searching"), None) == make("searching")
    for name in ("shortest", "multi-start", "lying"):
        assert with_seconds(make(name), 0.25) == make(name)
    run_ = run("searching", 2.0, FIELD, 0)
    assert run_.route is not None
    assert [when for when, _ in run_.route.progress] == [2e-3, 4e-3, 6e-3]


def stub_run(
    progress: list[tuple[float, float]], seconds: float, gap: float | None, planner: str = "one"
) -> Run:
    """A run with an exact length of 100 m."""
    route = None
    if progress:
        route = Route(points=np.array([[0, 0], [9, 9]]), length=progress[-1][1], progress=progress)
    template = measure(planner, FIELD, 0, CRASHED, seconds)
    run_ = replace(template, route=route, exact_length=100.0)
    if gap is None:
        return run_
    control = make("shortest").plan(FIELD, initial_state(FIELD), 0).control
    return replace(
        run_, status="solved", control=control, length=100.0 * (1.0 + gap), min_turn_radius=2.0
    )


def test_seeds_of_one_field_do_not_make_success_surer() -> None:
    template = stub_run([(1.0, 150.0)], 2.0, 0.1)
    other = replace(template, field=get_field("sparse/train:1"))
    once = statistics([template, other])
    often = statistics(
        [replace(run_, seed=seed) for run_ in (template, other) for seed in range(9)]
    )
    assert (often["successes"], often["success_low"]) == (18, once["success_low"])


def test_statistics_of_gaps_leave_failures_out_and_times_do_not() -> None:
    mine = [
        stub_run([(1.0, 150.0)], 2.0, 0.1),
        stub_run([(3.0, 120.0)], 4.0, 0.3),
        stub_run([], 9.0, None),
        stub_run([], 8.0, None),
        stub_run([], 7.0, None),
    ]
    told = statistics(mine)
    assert (told["runs"], told["successes"]) == (5, 2)
    assert told["failures"] == {"crashed (gone)": 3}
    assert told["gap_median"] == pytest.approx(0.1)
    assert told["gap_99"] == pytest.approx(0.3)
    assert told["raw_gap_median"] == pytest.approx(0.2)
    assert told["seconds_first_median"] is None
    assert told["seconds_median"] == 7.0
    assert statistics(mine[:4])["seconds_first_median"] == 3.0


def test_the_median_of_progress_begins_when_half_have_a_route() -> None:
    mine = [
        stub_run([(1.0, 150.0), (2.0, 130.0)], 5.0, 0.1),
        stub_run([(2.0, 120.0), (4.0, 110.0)], 5.0, 0.1),
        stub_run([], 6.0, None),
    ]
    times, gaps = median_progress(mine)
    np.testing.assert_array_equal(times, [2.0, 4.0, 5.0])
    np.testing.assert_allclose(gaps, [0.3, 0.3, 0.3])
    times, gaps = median_progress(mine[:2])
    np.testing.assert_array_equal(times, [1.0, 2.0, 4.0, 5.0])
    np.testing.assert_allclose(gaps, [0.5, 0.2, 0.1, 0.1])


@pytest.mark.parametrize("number", [0, 1, 15])
def test_pictures_are_drawn_of_any_outcome(number: int, tmp_path: Path) -> None:
    some = [
        stub_run([(0.1, 130.0), (0.2, 100.0)], 1.0, 0.5 * LEAST_GAP * k, f"planner-{k}")
        for k in range(number)
    ]
    draw([*some, stub_run([], 1.0, None, "failed")], tmp_path)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_path_is_as_long_as_its_segments(results: Path) -> None:
    plan = make("shortest").plan(FIELD, initial_state(FIELD), 0)
    first = rows(results / "planners.csv")[0]
    assert float(first["length"]) == pytest.approx(length(plan.control).sum(), rel=1e-12)


def test_what_was_finished_is_kept_when_a_planner_is_at_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PLANNERS, "faulty", Faulty)
    with pytest.raises(TypeError, match="no such thing"):
        main([*BENCH, "--planner", "faulty", "--out", str(tmp_path / "out")])
    assert [row["field"] for row in rows(tmp_path / "out" / "planners.csv")] == ["sparse/train:0"]


def test_every_planner_of_the_catalog_has_a_colour_and_a_marker_of_its_own() -> None:
    ours = [make for make in PLANNERS.values() if make.__module__.startswith("planners.")]
    for values in (styles.COLOURS, styles.MARKERS):
        assert len(set(values)) == len(values) >= len(ours) >= 15
