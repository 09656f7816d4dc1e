"""Results and chunks that were damaged: one error that names the file, and where."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.evaluation import flight_table, records
from agents.evaluation.report.page import write_report
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
        (b"goal_reached,1,146.0", b"goal_reached,1,nan", "line 2: nan is no number that is meas"),
        (b"goal_reached,1,146.0", b"goal_reached,1,inf", "line 2: inf is no number that is meas"),
        (b"goal_reached,1,146.0", b"goal_reached,1,-3", "line 2: lengths '-3' and"),
        (
            b"goal_reached,1,146.0",
            b"goal_reached,0,146.0",
            "success '0' of a flight that ends goal",
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
        flight_table.read(results)


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


def changed(name: str, change: Callable[[Any], Any]) -> dict[str, Any]:
    keys = [("guided+shield", "a", seed) for seed in range(4)]
    packed = records.pack([stub(*key) for key in keys])
    records.check(packed, 4)
    return packed | {name: change(packed[name])}


@pytest.mark.parametrize(
    ("name", "change", "match"),
    [
        ("control", lambda array: array[1:], "control are not as many as segments say"),
        (
            "decisions",
            lambda array: -array - 1,
            "decision_seconds are not as many as decisions say",
        ),
        ("length", lambda array: array[1:], "not 4 flights in length"),
        ("length", lambda array: array * np.nan, "NaN in length"),
        ("length", lambda array: array.astype(str), "length is .* of <U"),
        ("control", lambda array: array[..., None], "control is .* of float64"),
        ("outcome", lambda array: array + np.int8(99), "codes of outcome that are none"),
        ("hands", lambda array: array - np.int8(9), "codes of hands that are none"),
    ],
)
def test_a_chunk_that_was_changed_is_refused(
    name: str, change: Callable[[Any], Any], match: str
) -> None:
    packed = changed(name, change)
    with pytest.raises(ValueError, match=match):
        records.check(packed, 4)
    del packed[name]
    with pytest.raises(ValueError, match=f"no {name}"):
        records.check(packed, 4)


@pytest.mark.parametrize("content", [b"", b"PK", b"\x93NUMPY", b"PK\x03\x04" + bytes(60)])
def test_arrays_that_cannot_be_read_are_refused_and_the_file_is_closed(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(tmp_path / "a.npz")
