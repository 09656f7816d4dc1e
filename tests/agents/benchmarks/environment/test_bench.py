"""`ferguson bench env`: what it counts, compares, prints and writes."""

import csv
import json
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from rich.console import Console

from agents.benchmarks.environment import bench, drivers, startup
from agents.benchmarks.environment.bench import Request, Row, measure, ratios, speeds, summary
from agents.benchmarks.environment.drivers import (
    Entry,
    ForBaselines,
    OneByOne,
    Slice,
    Together,
    entries,
)
from agents.benchmarks.environment.subprocess_envs import in_processes
from agents.cli.main import main
from agents.runtime.terminal import Terminal
from ferguson_gym.environment import ObstacleField

REQUEST = Request(observation="discs", seconds=1e-9, rounds=3, seed=0, first_step=False)
NO_TIME = 1e-9
"""Seconds in which a driver makes as few calls as it can."""


class Flights(gym.Env[Any, Any]):
    """Each flight has three steps, the last of every second one by truncation."""

    def __init__(self) -> None:
        self.steps = self.resets = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        self.resets += 1
        return 0, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.steps += 1
        over, second = self.steps % 3 == 0, self.resets % 2 == 0
        return 0, 0.0, over and not second, over and second, {}


class ManyFlights(VectorEnv[Any, Any, Any]):
    """Flights of environment i have i + 1 steps; the call after the last resets."""

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.lengths = np.arange(num_envs) + 1
        self.steps = self.ends = self.calls = 0

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        self.flown = np.zeros(self.num_envs, int)
        return 0, {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        assert actions.shape == (self.num_envs, 4)
        self.calls += 1
        fresh = self.flown == self.lengths
        self.flown = np.where(fresh, 0, self.flown + 1)
        over = self.flown == self.lengths
        self.steps += int((~fresh).sum())
        self.ends += int(over.sum())
        odd = self.lengths % 2 == 1
        return 0, np.zeros(self.num_envs), over & odd, over & ~odd, {}


def total(slices: list[Slice]) -> tuple[int, int]:
    return sum(one.steps for one in slices), sum(one.flights for one in slices)


def test_scalar_steps_are_counted_and_flights_follow_each_other() -> None:
    env = Flights()
    driver = OneByOne(env, np.zeros((5, 1, 4), np.float32))
    driver.reset(0)
    slices = [driver.run(NO_TIME) for _ in range(7)] + [driver.run(0.01)]
    assert [one.steps for one in slices[:7]] == [1] * 7
    assert [one.flights for one in slices[:7]] == [0, 0, 1, 0, 0, 1, 0]
    assert total(slices) == (env.steps, env.steps // 3)
    assert env.resets == 2 + env.steps // 3
    assert slices[-1].seconds >= 0.01


def test_steps_that_reset_do_not_count() -> None:
    envs = ManyFlights(3)
    driver = Together(envs, np.zeros((5, 3, 4), np.float32))
    driver.reset(0)
    slices = [driver.run(NO_TIME) for _ in range(10)]
    assert envs.calls == 20
    # environment 0 steps in every second call, 1 in two of three, 2 in three of four
    assert total(slices) == (10 + 14 + 15, 10 + 7 + 5)
    slices.append(driver.run(0.01))
    assert total(slices) == (envs.steps, envs.ends)


def test_a_reset_forgets_flights_that_were_over() -> None:
    envs = ManyFlights(2)
    driver = Together(envs, np.zeros((5, 2, 4), np.float32))
    driver.reset(0)
    assert driver.run(NO_TIME).steps == 3
    driver.reset(1)
    assert driver.run(NO_TIME).steps == 3


def test_all_steps_of_a_vec_env_count() -> None:
    class VecFlights:
        num_envs, calls, seeded = 4, 0, -1

        def seed(self, seed: int) -> None:
            self.seeded = seed

        def reset(self) -> None:
            assert self.seeded == 5

        def step(self, actions: Any) -> tuple[Any, Any, Any, Any]:
            self.calls += 1
            return 0, 0, np.array([True, False, False, self.calls % 2 == 0]), [{}] * 4

    envs = VecFlights()
    driver = ForBaselines(envs, np.zeros((5, 4, 4), np.float32))
    driver.reset(5)
    slices = [driver.run(NO_TIME) for _ in range(4)]
    assert total(slices) == (16, 6)


def test_rounds_are_interleaved_and_warmed_up_before() -> None:
    ran: list[str] = []

    class Recorder:
        def __init__(self, env: str, actions: Any) -> None:
            self.name = env

        def reset(self, seed: int) -> None:
            ran.append(f"{self.name} reset")

        def run(self, seconds: float) -> Slice:
            ran.append(self.name)
            return Slice(1, 0, seconds)

    fakes = [
        Entry(name=n, number=1, make=partial(nullcontext, n), driver=Recorder, fields=0)
        for n in "ab"
    ]
    slices = measure(fakes, REQUEST, Terminal(quiet=True).still_bar())
    assert ran == ["a reset", "a", "b reset", "b", *["a", "b"] * 3]
    assert {row: len(rounds) for row, rounds in slices.items()} == {("a", 1): 3, ("b", 1): 3}


def test_ratios_are_taken_within_rounds() -> None:
    speeds_of = {
        Row("ObstacleField", 1): (100, 200, 1000),
        Row("CartPole-v1", 1): (100, 50, 1000),
        Row("ObstacleField vector", 256): (7, 7, 7),
    }
    slices = {row: [Slice(2 * s, 2, 2.0) for s in each] for row, each in speeds_of.items()}
    report = summary(slices, [], {}, REQUEST)
    # the ratio of the medians would be 2
    assert report["ratios"] == [
        {
            "of": {"environment": "ObstacleField", "number": 1},
            "to": {"environment": "CartPole-v1", "number": 1},
            "median": 1.0,
            "least": 1.0,
            "greatest": 4.0,
        }
    ]
    first = report["environments"][0]
    assert first["steps_per_second"] == {"median": 200.0, "least": 100.0, "greatest": 1000.0}
    assert first["steps_a_flight"] == 2600 / 6


def test_every_ratio_is_of_rows_that_are_there() -> None:
    rows = {Row(entry.name, entry.number) for entry in entries("discs")}
    assert len(rows) == 11
    assert {row for pair in bench.RATIOS for row in pair} <= rows


def test_actions_are_small_and_repeat() -> None:
    for entry in entries("discs"):
        actions, again = (entry.actions(np.random.default_rng(3)) for _ in range(2))
        np.testing.assert_array_equal(actions, again)
        assert actions.shape[1] == entry.number
        if entry.name.startswith("CartPole"):
            assert set(np.unique(actions)) == {0, 1}
        else:
            assert actions.dtype == np.float32
            assert actions.std() == pytest.approx(0.05, rel=0.05)
            assert abs(actions).max() <= 1.0


@pytest.mark.parametrize("number", [1, 16])
def test_warming_up_lays_out_all_fields(number: int) -> None:
    entry = next(
        e for e in entries("discs", 500) if (e.name, e.number) == ("ObstacleField vector", number)
    )
    with entry.make() as envs:
        rng = np.random.default_rng(0)
        entry.warm_up(entry.driver(envs, entry.actions(rng)), rng)
        assert len(envs._simulator._drawn.seeds) > 0.998 * envs.settings.fields


@pytest.fixture
def few_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers, "entries", partial(entries, fields=64))
    monkeypatch.setattr(startup, "STARTS", 1)


@pytest.mark.usefixtures("few_fields")
@pytest.mark.parametrize("observation", ["discs", "rays"])
def test_tables_and_files_tell_the_same(
    observation: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)  # fresh processes find the packages from anywhere
    seconds = "0.01"
    if observation == "rays":  # also in no time, and without Stable-Baselines3
        seconds = "1e-9"
        monkeypatch.setattr(drivers, "has_baselines", lambda: False)
    else:
        pytest.importorskip("stable_baselines3")
    arguments = ["--observation", observation, "--seconds", seconds, "--rounds", "2"]
    assert main(["bench", "env", *arguments, "--seed", "7", "--out", "deep/results"]) == 0
    printed, err = capsys.readouterr()
    assert err == "wrote steps.csv, summary.json to deep/results\n"
    report = json.loads(Path("deep/results/summary.json").read_text())
    with Path("deep/results/steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))

    assert (report["observation"], report["rounds"], report["seed"]) == (observation, 2, 7)
    names = [(one["environment"], one["number"]) for one in report["environments"]]
    absent = [(one["environment"], one["number"]) for one in report["not_installed"]]
    known = [
        ("ObstacleField", 1),
        *(("ObstacleField vector", number) for number in (1, 16, 256, 2048)),
        ("ObstacleField for SB3", 256),
        ("ObstacleField SyncVectorEnv", 16),
        ("ObstacleField SubprocVecEnv", 2),
        ("CartPole-v1", 1),
        ("CartPole-v1 vector", 256),
        ("CartPole-v1 vector", 2048),
    ]
    assert sorted(names + absent) == sorted(known)
    assert absent == ([] if observation == "discs" else [known[5], known[7]])
    assert len(report["ratios"]) == (5 if observation == "discs" else 4)
    for name, number in absent:
        assert any(
            line.split() == [*name.split(), str(number), "not", "installed", "-", "-", "-"]
            for line in printed.splitlines()
        )
    assert ("'.[agents]'" in printed) == bool(absent)

    assert [(r["environment"], int(r["number"]), int(r["round"])) for r in rows] == [
        (*name, k) for name in names for k in range(2)
    ]
    for one in report["environments"]:
        mine = [
            r
            for r in rows
            if (r["environment"], int(r["number"])) == (one["environment"], one["number"])
        ]
        each = [int(r["steps"]) / float(r["seconds"]) for r in mine]
        told = one["steps_per_second"]
        assert told == {"median": np.median(each), "least": min(each), "greatest": max(each)}
        median = f"{told['median']:,.0f}"
        start = [*one["environment"].split(), str(one["number"]), median]
        assert sum(line.split()[: len(start)] == start for line in printed.splitlines()) == 1
    fresh = report["fresh_process"]
    assert 0.0 < fresh["import_seconds"] < fresh["first_step_seconds"] < 60.0
    assert fresh["compile_seconds"] is None
    assert f"{fresh['import_seconds']:.2f} s" in printed
    if fresh["process_bytes"] is not None:
        # at least the flights' segments: 2048 times 41 times 8 numbers
        assert 5e6 < fresh["many_bytes"] < 1e9
        assert 3e7 < fresh["process_bytes"] < 2e9


def test_tables_fit_into_eighty_columns() -> None:
    row = Row("ObstacleField SyncVectorEnv", 2048)
    slices = {row: [Slice(12_345_678, 1_000_000, 1.0)] * 2}
    slices |= {row: [Slice(90, 0, 1.0)] for pair in bench.RATIOS for row in pair}
    report = summary(slices, [Row("ObstacleField SubprocVecEnv", 2)], {}, REQUEST)
    console = Console(width=80)
    for table in (speeds(report), ratios(report)):
        assert console.measure(table).maximum <= 80


@pytest.mark.slow
def test_an_empty_cache_has_to_be_filled() -> None:
    fresh = startup.measure("discs", with_compilation=True)
    assert fresh["compile_seconds"] is not None
    assert fresh["first_step_seconds"] is not None
    assert fresh["compile_seconds"] > 2.0 * fresh["first_step_seconds"]


def test_a_fresh_process_that_fails_says_why() -> None:
    with pytest.raises(RuntimeError, match="unknown observation 'stars'"):
        startup.measure("stars", with_compilation=False)


def test_processes_end_when_their_use_is_interrupted() -> None:
    pytest.importorskip("stable_baselines3")
    makers = [partial(ObstacleField, fields=1)] * 2
    began = []

    def interrupted() -> None:
        with in_processes(makers) as envs:
            began.append(envs)
            envs.reset()
            envs.step_async(np.zeros((2, 4), np.float32))
            envs.remotes[0].recv()  # half an answer: to ask for it again would wait forever
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    processes = began[0].processes
    assert len(processes) == 2
    assert not any(process.is_alive() for process in processes)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--observation", "stars"], "invalid choice: 'stars'"),
        (["--seconds", "0"], "need a positive number of seconds, got '0'"),
        (["--seconds", "inf"], "need a positive number of seconds, got 'inf'"),
        (["--seconds", "nan"], "need a positive number of seconds, got 'nan'"),
        (["--seconds", "long"], "need a positive number of seconds, got 'long'"),
        (["--rounds", "0"], "an integer >= 1"),
        (["--seed", "-1"], "--seed"),
        (["--seed", str(2**63)], "at most 2**63 - 1"),
        (["--out", "taken"], "is a file, not a directory"),
        (["--out", "taken/deeper"], "is a file, not a directory"),
        (["kites"], "unrecognized arguments: kites"),
    ],
)
def test_bad_arguments_are_one_line_and_status_two(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("mine")
    assert main(["bench", "env", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert Path("taken").read_text() == "mine"
