"""The log for OMPL's statistics, read back by its documented grammar."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
import pytest

from agents.benchmarks.planners.ompl_log import STATUSES, write
from agents.benchmarks.planners.runs import Run, measure, run
from ferguson_gym.world.field_names import get_field
from planners.interface import Route, initial_state
from planners.registry import PLANNERS
from tests.support.stub_planners import STUBS

TYPES = {"BOOLEAN": int, "INTEGER": int, "REAL": float}
BEGAN = datetime(2026, 3, 4, 5, 6, 7)


def after(line: str, words: str) -> str:
    assert line.startswith(words), line
    return line[len(words) :]


def before(line: str, words: str) -> str:
    assert line.endswith(words), line
    return line[: -len(words)]


def word(text: str) -> str:
    assert text
    assert not set(" \t|") & set(text), text
    return text


def block(rest: Iterator[str]) -> str:
    assert next(rest) == "<<<|"
    return "\n".join(iter(lambda: next(rest), "|>>>"))


def properties(rest: Iterator[str], count: str, words: str) -> list[tuple[str, str]]:
    found = [next(rest).rpartition(" ") for _ in range(int(before(count, words)))]
    return [(name, kind) for name, _, kind in found]


def datum(cell: str, kind: str) -> float | None:
    return TYPES[kind](cell) if cell else None


def sample(text: str, number: int) -> tuple[float, ...]:
    cells = before(text, ",").split(",")
    assert len(cells) == number
    return tuple(float(cell) for cell in cells)


def read(lines: list[str]) -> dict[str, Any]:
    """A log as OMPL's documentation has its grammar; every line must have its place."""
    rest = iter(lines)
    log: dict[str, Any] = {}
    library, version = next(rest).split(" version ")
    log["version"] = (library, version)
    log["experiment"] = word(after(next(rest), "Experiment "))
    log["host"] = word(after(next(rest), "Running on "))
    log["date"] = after(next(rest), "Starting at ")
    log["setup"], log["processor"] = block(rest), block(rest)
    log["seed"] = int(before(next(rest), " is the random seed"))
    log["time_limit"] = float(before(next(rest), " seconds per run"))
    log["memory_limit"] = float(before(next(rest), " MB per run"))
    log["runs"] = int(before(next(rest), " runs per planner"))
    log["total"] = float(before(next(rest), " seconds spent to collect the data"))
    log["enums"] = {}
    for _ in range(int(before(next(rest), " enum type"))):
        name, *values = next(rest).split("|")
        log["enums"][name] = [word(value) for value in values]
    log["planners"] = {}
    for _ in range(int(before(next(rest), " planners"))):
        name = word(next(rest))
        for _ in range(int(before(next(rest), " common properties"))):
            assert " = " in next(rest)
        columns = properties(rest, next(rest), " properties for each run")
        measured = [
            {key: datum(cell, kind) for (key, kind), cell in zip(columns, cells, strict=True)}
            for cells in (
                before(next(rest), "; ").split("; ")
                for _ in range(int(before(next(rest), " runs")))
            )
        ]
        progress = None
        if (line := next(rest)) != ".":
            columns = properties(rest, line, " progress properties for each run")
            assert [key for key, _ in columns] == ["time", "best cost"]
            progress = []
            for _ in range(int(before(next(rest), " runs"))):
                samples = next(rest).split(";")
                assert samples.pop() == ""  # each is closed
                progress.append([sample(one, len(columns)) for one in samples])
            assert next(rest) == "."
        log["planners"][name] = (measured, progress)
    assert list(rest) == []
    return log


@pytest.fixture(scope="module")
def some() -> list[Run]:
    with pytest.MonkeyPatch.context() as patch:
        for name, stub in STUBS.items():
            patch.setitem(PLANNERS, name, stub)
        fields = [get_field("sparse/train:0"), get_field("sparse/train:1")]
        names = ["shortest", "searching", "without", "lying"]
        return [run(name, None, field, 5) for field in fields for name in names]


def test_the_log_reads_by_its_grammar(some: list[Run]) -> None:
    log = read(list(write(some, BEGAN, 12.5, None)))
    assert log["version"][0] == "ferguson-gym"
    assert log["date"] == "2026-03-04 05:06:07"
    assert (log["seed"], log["runs"], log["total"]) == (5, 2, 12.5)
    assert log["time_limit"] == log["memory_limit"] == 0.0
    assert log["enums"] == {
        "status": list(STATUSES),
        "field": ["sparse/train:0", "sparse/train:1"],
    }
    assert list(log["planners"]) == ["shortest", "searching", "without", "lying"]
    assert read(list(write(some, BEGAN, 12.5, 0.5)))["time_limit"] == 0.5


def test_every_run_is_told_as_it_was(some: list[Run]) -> None:
    log = read(list(write(some, BEGAN, 12.5, None)))
    for name, (measured, _) in log["planners"].items():
        mine = [run for run in some if run.planner == name]
        for k, (told, one_run) in enumerate(zip(measured, mine, strict=True)):
            assert told["field"] == k
            assert told["seed"] == 5
            assert STATUSES[told["status"]] == one_run.status
            assert told["solved"] == (name in ("shortest", "searching"))
            assert told["solution length"] == one_run.length
            assert told["route length"] == one_run.raw_length
            assert told["exact length"] == one_run.exact_length
            assert told["solution segments"] == one_run.segments
            assert told["time"] == one_run.seconds
            assert told["gap"] == one_run.gap


def test_progress_is_told_of_planners_that_improve(some: list[Run]) -> None:
    planners = read(list(write(some, BEGAN, 12.5, None)))["planners"]
    assert [name for name, (_, progress) in planners.items() if progress] == ["searching"]
    exact = [run.exact_length for run in some if run.planner == "searching"]
    for series, length in zip(planners["searching"][1], exact, strict=True):
        expected = [(1e-3, 1.2 * length), (2e-3, 1.1 * length), (3e-3, length)]
        np.testing.assert_allclose(series, expected)


def test_a_run_without_a_route_has_an_empty_series(some: list[Run]) -> None:
    first, second = (run for run in some if run.planner == "searching")
    crashed = STUBS["crashing"]().plan(second.field, initial_state(second.field), 5)
    lost = replace(measure("searching", second.field, 5, crashed, 1.0), route=None)
    _, progress = read(list(write([first, lost], BEGAN, 1.0, None)))["planners"]["searching"]
    assert [len(series) for series in progress] == [3, 0]


def test_no_moment_is_told_twice(some: list[Run]) -> None:
    first = next(run for run in some if run.planner == "searching")
    route = Route(
        points=np.zeros((2, 2)), length=140.0, progress=[(0.5, 160.0), (0.5, 150.0), (0.7, 140.0)]
    )
    log = read(list(write([replace(first, route=route)], BEGAN, 1.0, None)))
    assert log["planners"]["searching"][1] == [[(0.5, 150.0), (0.7, 140.0)]]


def test_names_of_fields_are_words_and_straight_flights_have_an_infinite_radius(
    some: list[Run],
) -> None:
    first = some[0]
    odd = replace(first.field, name="my field | two")
    lines = list(write([replace(first, field=odd, min_turn_radius=np.inf)], BEGAN, 1.0, None))
    log = read(lines)
    assert log["enums"]["field"] == ["my_field_two"]
    (told,) = log["planners"]["shortest"][0]
    assert told["minimum turn radius"] == np.inf
