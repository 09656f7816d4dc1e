"""Results and chunks that were damaged: one error that names the file, and where."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.evaluation import reading
from agents.evaluation.report.page import write_report
from agents.flights.flight_table import Columns, check, join
from agents.runtime.safe_npz import read_arrays
from tests.agents.evaluation.test_work import stub
from tests.support.written_results import write_results


@pytest.fixture
def results(tmp_path: Path) -> Path:
    return write_results(tmp_path / "results", {"guided": {"paper:1": [146.0, None]}})


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (b"guided,paper:1,1", b"guided,paper:\xff,1", r"flights\.csv, line [12]: 'utf-8' codec"),
        (b"goal_reached,1,146.0", b"goal_reached,1,nan", "line 2: nan is not a measured number"),
        (b"goal_reached,1,146.0", b"goal_reached,1,inf", "line 2: inf is not a measured number"),
        (b"goal_reached,1,146.0", b"goal_reached,1,-3", "line 2: lengths '-3' and"),
        (
            b"goal_reached,1,146.0",
            b"goal_reached,0,146.0",
            "success '0' of a flight with outcome goal",
        ),
        (b"goal_reached,1,146.0", b"landed,1,146.0", "line 2: unknown outcome 'landed'"),
        (b"goal_reached,1,146.0", b"goal_reached,,146.0", "line 2: success ''"),
    ],
)
def test_a_table_that_was_damaged_is_refused(
    results: Path, old: bytes, new: bytes, match: str
) -> None:
    place = results / "flights.csv"
    assert old in place.read_bytes()
    place.write_bytes(place.read_bytes().replace(old, new))
    with pytest.raises(ValueError, match=match):
        reading.read(results)


@pytest.mark.parametrize("offsets", [["0", "1", "2"], [[0, 1, 2]], [0, 5, 2], [0.0, 1.0, 2.0]])
def test_paths_with_odd_offsets_are_refused(results: Path, offsets: Any) -> None:
    np.savez(results / "paths.npz", control=np.zeros((2, 4, 2)), offsets=np.array(offsets))
    with pytest.raises(ValueError, match=r"paths\.npz does not hold the paths of flights"):
        write_report(results)


@pytest.mark.parametrize(
    "policies",
    [
        None,
        3,
        [None],
        [{"policy": []}],
        [{"policy": "guided", "decision_seconds_99": "x"}],
        "[1e999]",
    ],
)
def test_a_report_takes_no_times_from_a_summary_that_has_none(results: Path, policies: Any) -> None:
    told = {"policies": policies}
    if policies == "[1e999]":
        told = {"policies": [{"policy": "guided", "decision_seconds_median": 1e308 * 10}]}
    (results / "summary.json").write_text(json.dumps(told))
    write_report(results)
    assert (results / "report.html").is_file()


def test_a_deep_summary_is_refused(results: Path) -> None:
    (results / "summary.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match=r"summary\.json: not JSON"):
        write_report(results)


def changed(name: str, change: Callable[[Any], Any]) -> Columns:
    keys = [("guided+shield", "a", seed) for seed in range(4)]
    columns = join([stub(*key) for key in keys])
    check(columns, 4)
    return {**columns, name: change(columns[name])}


@pytest.mark.parametrize(
    ("name", "change", "match"),
    [
        ("control", lambda array: array[1:], "control has .* rows, unlike segments"),
        ("window_counts", lambda array: -array - 1, "window_segments has .* rows, unlike window_"),
        ("length", lambda array: array[1:], "not 4 flights in length"),
        ("length", lambda array: array * np.nan, "NaN in length"),
        ("length", lambda array: array.astype(str), "length is .* of <U"),
        ("control", lambda array: array[..., None], "control is .* of float64"),
        ("outcome", lambda array: array + np.int8(99), "unknown codes of outcome"),
    ],
)
def test_a_chunk_that_was_changed_is_refused(
    name: str, change: Callable[[Any], Any], match: str
) -> None:
    columns = changed(name, change)
    with pytest.raises(ValueError, match=match):
        check(columns, 4)
    with pytest.raises(ValueError, match=f"no {name}"):
        check({key: columns[key] for key in columns if key != name}, 4)


@pytest.mark.parametrize("content", [b"", b"PK", b"\x93NUMPY", b"PK\x03\x04" + bytes(60)])
def test_arrays_that_cannot_be_read_are_refused_and_the_file_is_closed(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(tmp_path / "a.npz")
