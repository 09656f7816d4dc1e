"""Imitation as `ferguson train` does it: the same model with any workers and any interruption."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import torch
import yaml

from agents.cli.main import main
from agents.cli.shared_options import RESUME_NOTE
from agents.flights.batched import fly_batch
from agents.flights.metrics import score
from agents.models import loading
from agents.training.imitation import dagger_rollouts, demonstration_data
from agents.training.imitation.behavior_cloning import BehaviorCloning
from agents.training.imitation.dataset import COLUMNS, ImitationDataset
from agents.training.learning_curve import Record
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field_names import get_fields
from planners.interface import initial_state
from planners.receding_horizon.pursuit import Pursuit
from tests.support.small_models import card_of, same, saved, weights_of
from tests.support.waiting import until

CHOSEN, REPORTED = "sparse/validation:0-2", "sparse/validation:3-5"
TINY: dict[str, Any] = {
    "n_envs": 3,
    "n_timesteps": 300,
    "eval_freq": 60,
    "policy": "deepsets-mixture",
    "policy_kwargs": {
        "net_arch": [8],
        "components": 2,
        "features_extractor_kwargs": {"width": 4},
    },
    "env_kwargs": {"suite": "sparse", "observation": "both", "nearest": 3, "rays": 5},
    "first": 2,
    "updates": 4,
    "batch_size": 16,
    "learning_rate": "lin_1e-2",
}

Command = Callable[..., list[str]]


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """Of a tiny training in tmp_path/out."""

    def arguments(algorithm: str, *more: str, **changes: Any) -> list[str]:
        config = tmp_path / f"{algorithm}.yml"
        config.write_text(yaml.safe_dump({ENVIRONMENT_ID: {**TINY, **changes}}))
        where = ["--config", str(config), "--out", str(tmp_path / "out")]
        fields = ["--choose-on", CHOSEN, "--report-on", REPORTED]
        return ["train", algorithm, *where, *fields, *more]

    return arguments


class Flights:
    """Demonstrations, of which nothing lies on disk."""

    def __init__(self, number: int) -> None:
        self.fields = tuple(f"sparse/train:{k}" for k in range(number))
        flown = []
        for field in (one for name in self.fields for one in get_fields(name)):
            plan = Pursuit().plan(field, initial_state(field), 0)
            vehicles = [state.vehicle for state in plan.states]
            flown.append(
                [
                    encode(control, vehicle.position, vehicle.derivative)
                    for control, vehicle in zip(plan.control, vehicles[:-1], strict=True)
                ]
            )
        self.actions = np.array([action for one in flown for action in one]).reshape(-1, 4)
        self.offsets = np.cumsum([0, *map(len, flown)])


@pytest.fixture
def demos(monkeypatch: pytest.MonkeyPatch) -> Flights:
    flights = Flights(4)
    kept = {"some/pursuit-v0": flights, "some/none-v0": Flights(0)}
    monkeypatch.setattr(demonstration_data, "read", kept.__getitem__)
    return flights


def curve_of(directory: Path) -> list[dict[str, str]]:
    """All but what a clock decides."""
    with (directory / "curve.csv").open() as file:
        return [{**row, "minutes": ""} for row in csv.DictReader(file)]


def test_dagger_leaves_a_model_its_card_and_its_curve(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("dagger", "--seed", "3")) == 0
    out = tmp_path / "out"
    names = {"model.zip", "model.json", "run.json", "curve.csv", "best", "tensorboard"}
    assert {path.name for path in out.iterdir()} == names
    model = loading.load(out)
    card = model.card
    assert (card.algorithm, card.policy, card.seed) == ("dagger", "deepsets-mixture", 3)
    assert card.environment == TINY["env_kwargs"]
    steps = [row["steps"] for row in card.curve]
    assert steps == sorted(set(steps))
    assert len(steps) > 2
    assert steps[-1] >= 300
    for key, spec in (("chosen_on", CHOSEN), ("reported_on", REPORTED)):
        assert card.results[key]["spl"] == score(fly_batch(model, get_fields(spec))).spl
    assert "SPL" in capsys.readouterr().out
    # the same command has nothing left to do
    assert main(command("dagger", "--seed", "3")) == 0
    assert "holds this training, finished" in capsys.readouterr().err


def test_a_learner_learns_what_the_expert_does(command: Command, tmp_path: Path) -> None:
    costs = []
    update = BehaviorCloning.update

    def watched(self: BehaviorCloning, *others: Any, **more: Any) -> dict[str, float]:
        costs.append(update(self, *others, **more))
        return costs[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BehaviorCloning, "update", watched)
        assert main(command("dagger", updates=40)) == 0
    unlikely = np.array([cost["unlikely"] for cost in costs])
    assert np.isfinite(unlikely).all()
    assert unlikely[-20:].mean() < unlikely[:20].mean() - 1.0
    short = np.array([cost["violation"] for cost in costs])
    assert short[-20:].mean() < short[:20].mean()


def test_the_seed_decides_on_the_model(command: Command, tmp_path: Path) -> None:
    found = []
    for seed in ("0", "0", "1"):
        assert main(command("dagger", "--seed", seed, "--fresh")) == 0
        found.append(weights_of(tmp_path / "out"))
    assert same(found[0], found[1])
    assert not same(found[0], found[2])


@pytest.mark.parametrize("threads", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_one_worker_or_two_end_with_the_same_weights(
    threads: str, command: Command, tmp_path: Path
) -> None:
    found = []
    for workers in ("1", "2"):
        more = ("--workers", workers, "--threads", threads, "--fresh")
        assert main(command("dagger", *more)) == 0
        found.append((weights_of(tmp_path / "out"), curve_of(tmp_path / "out")))
    torch.set_num_threads(1)
    assert same(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]


def press_in_consider(patch: pytest.MonkeyPatch) -> None:
    """Ctrl-C during the first evaluation."""
    consider = Record.consider

    def interrupted(self: Record, *others: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return consider(self, *others)

    patch.setattr(Record, "consider", interrupted)


def press_in_update(patch: pytest.MonkeyPatch, number: int) -> None:
    """Ctrl-C during an update, counted from 1."""
    update, done = BehaviorCloning.update, []

    def interrupted(self: BehaviorCloning, *others: Any, **more: Any) -> Any:
        done.append(update(self, *others, **more))
        if len(done) == number:
            signal.raise_signal(signal.SIGINT)
        return done[-1]

    patch.setattr(BehaviorCloning, "update", interrupted)


def press_in_flights(patch: pytest.MonkeyPatch, number: int) -> None:
    """Ctrl-C during a share of flights, counted from 1."""
    visit, done = dagger_rollouts.visit, []

    def interrupted(*asked: Any) -> Any:
        done.append(visit(*asked))
        if len(done) == number:
            signal.raise_signal(signal.SIGINT)
        return done[-1]

    patch.setattr(dagger_rollouts, "visit", interrupted)


PRESSES: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "after the first round": press_in_consider,
    "in the first flights": lambda patch: press_in_flights(patch, 3),
    "in the flights of a round": lambda patch: press_in_flights(patch, 28),
    "in the updates of the first round": lambda patch: press_in_update(patch, 2),
    "in the updates of another round": lambda patch: press_in_update(patch, 7),
}


@pytest.mark.parametrize("when", PRESSES)
def test_an_interrupted_training_ends_as_one_that_was_not(
    when: str, command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str], demos: Flights
) -> None:
    line = command("dagger", "--demos", "some/pursuit-v0")
    assert main(line) == 0
    whole = weights_of(tmp_path / "out"), curve_of(tmp_path / "out")
    shutil.rmtree(tmp_path / "out")
    with pytest.MonkeyPatch.context() as patch:
        PRESSES[when](patch)
        assert main(line) == 130
    assert capsys.readouterr().err.endswith("ferguson: interrupted\n")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert not (tmp_path / "out/model.zip").exists()
    debris = [path.name for path in (tmp_path / "out").rglob("*.tmp*")]
    assert not debris
    assert main(line) == 0
    assert curve_of(tmp_path / "out") == whole[1]
    assert same(weights_of(tmp_path / "out"), whole[0])
    assert not (tmp_path / "out/checkpoint").exists()


def test_lessons_are_kept_and_not_flown_again(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        press_in_consider(patch)
        assert main(command("dagger")) == 130
    kept = [np.load(file) for file in sorted((tmp_path / "out/checkpoint").glob("rows-*.npy"))]
    assert len(kept) == 2  # the first flights and those of a round
    assert kept[0].shape[1] == COLUMNS
    assert not {*kept[0][:, 0]} & {*kept[1][:, 0]}  # in fields of their own
    added: list[np.ndarray] = []
    add = ImitationDataset.add

    def watched(self: ImitationDataset, rows: np.ndarray, *others: Any) -> None:
        added.append(rows)
        add(self, rows, *others)

    monkeypatch.setattr(ImitationDataset, "add", watched)
    assert main(command("dagger")) == 0
    for before, after in zip(kept, added, strict=False):
        np.testing.assert_array_equal(before, after)
    seeds = [seed for rows in added for seed in set(rows[:, 0])]
    assert len(seeds) == len(set(seeds))


def test_a_damaged_checkpoint_is_refused_and_fresh_starts_over(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with monkeypatch.context() as patch:
        press_in_consider(patch)
        assert main(command("dagger")) == 130
    capsys.readouterr()
    for name in ("state.pt", "rows-000001.npy"):
        file = tmp_path / "out/checkpoint" / name
        whole = file.read_bytes()
        file.write_bytes(whole[: len(whole) // 2])
        assert main(command("dagger")) == 2
        error = capsys.readouterr().err
        assert "cannot be read" in error
        assert "--fresh starts over" in error
        assert error.count("\n") == 1
        file.write_bytes(whole)
    assert main(command("dagger", "--fresh")) == 0


@pytest.mark.usefixtures("demos")
def test_bc_learns_from_demonstrations_and_dagger_goes_on_from_there(
    command: Command, tmp_path: Path
) -> None:
    costs = []
    update = BehaviorCloning.update

    def watched(self: BehaviorCloning, *others: Any, **more: Any) -> dict[str, float]:
        costs.append(update(self, *others, **more)["unlikely"])
        return {"unlikely": costs[-1]}

    line = command("bc", "--demos", "some/pursuit-v0", n_timesteps=1920, eval_freq=640, updates=40)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BehaviorCloning, "update", watched)
        assert main(line) == 0
    out = tmp_path / "out"
    assert np.mean(costs[-20:]) < np.mean(costs[:20]) - 1.0
    card = loading.load(out).card
    assert card.settings["demos"] == "some/pursuit-v0"
    assert [row["steps"] for row in card.curve] == [640, 1280, 1920]

    shutil.move(out, tmp_path / "cloned")
    begun = ("--from", str(tmp_path / "cloned"))
    # nothing is learned, so the weights stay; the network is that of the model
    more = {"learning_rate": 1e-30, "policy_kwargs": {"net_arch": [4]}}
    assert main(command("dagger", *begun, **more)) == 0
    for one, other in zip(weights_of(out), weights_of(tmp_path / "cloned"), strict=True):
        torch.testing.assert_close(one, other, atol=1e-6, rtol=1e-5)
    card = loading.load(out).card
    assert (card.algorithm, card.policy_kwargs) == ("dagger", TINY["policy_kwargs"])
    # and PPO goes on with either
    ppo = {"n_steps": 4, "batch_size": 4, "n_epochs": 1, "n_envs": 2, "n_timesteps": 16}
    recipe = {key: TINY[key] for key in ("eval_freq", "policy", "env_kwargs")} | ppo
    (tmp_path / "ppo.yml").write_text(yaml.safe_dump({ENVIRONMENT_ID: recipe}))
    line = ["train", "ppo", "--config", str(tmp_path / "ppo.yml"), "--from", str(out)]
    fields = ["--choose-on", CHOSEN, "--report-on", REPORTED]
    assert main([*line, *fields, "--out", str(tmp_path / "refined")]) == 0
    assert loading.load(tmp_path / "refined").card.policy == "deepsets-mixture"


@pytest.mark.slow
def test_a_fresh_process_flies_the_model_identically(command: Command, tmp_path: Path) -> None:
    assert main(command("dagger")) == 0
    program = (
        "import sys, numpy\n"
        "from agents.models import loading\n"
        "from agents.flights.batched import fly_batch\n"
        "from ferguson_gym.world.field_names import get_fields\n"
        "flights = fly_batch(loading.load(sys.argv[1]), get_fields(sys.argv[2]))\n"
        "numpy.save(sys.argv[3], numpy.concatenate([flight.control for flight in flights]))\n"
    )
    arguments = [str(tmp_path / "out"), "sparse/test:0-3", str(tmp_path / "there.npy")]
    subprocess.run([sys.executable, "-c", program, *arguments], check=True)
    here = fly_batch(loading.load(tmp_path / "out"), get_fields("sparse/test:0-3"))
    control = np.concatenate([flight.control for flight in here])
    assert len(control) > 4
    np.testing.assert_array_equal(np.load(tmp_path / "there.npy"), control)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [7.0, 12.0, 16.0])
def test_ctrl_c_on_a_terminal_stops_workers_quietly(
    seconds: float, command: Command, tmp_path: Path
) -> None:
    line = command("dagger", "--workers", "2", n_envs=60, first=8, updates=400, n_timesteps=10**7)
    training = subprocess.Popen(
        [sys.executable, "-m", "agents.cli.main", *line],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with training:
        assert until(lambda: (tmp_path / "out/run.json").exists(), 60.0)
        time.sleep(seconds - 6.0)  # among the first flights, or later
        os.killpg(training.pid, signal.SIGINT)  # as a terminal does: workers and all
        _, error = training.communicate(timeout=60.0)
    assert training.returncode == 130
    *learned, first, then, last = error.splitlines()
    assert all(" steps " in line for line in learned)  # a fast machine has evaluated before
    assert "stopping after this update, with a checkpoint" in first
    assert then == RESUME_NOTE
    assert last == "ferguson: interrupted"


@pytest.mark.parametrize(
    ("algorithm", "more", "changes", "match"),
    [
        ("dagger", [], {"expert": "oracle"}, "unknown planner 'oracle'; planners are"),
        ("dagger", [], {"expert": 3}, "unknown planner '3'; planners are"),
        (
            "dagger",
            [],
            {"expert": "astar"},
            "expert 'astar' plans its whole path at once",
        ),
        ("dagger", [], {"expert": "pursuit+wings"}, "unknown option 'wings' of planner 'pursuit'"),
        ("dagger", [], {"updates": 0}, "updates must be a whole number from 1 on, got 0"),
        ("dagger", [], {"updates": True}, "updates must be a whole number from 1 on, got True"),
        ("dagger", [], {"first": 1.5}, "first must be a whole number from 1 on, got 1.5"),
        ("dagger", [], {"batch_size": "all"}, "batch_size must be a whole number from 1 on, got"),
        ("dagger", [], {"scattered": 1.1}, "scattered must lie between 0 and 1, got 1.1"),
        ("dagger", [], {"scattered": True}, "scattered must lie between 0 and 1, got True"),
        ("dagger", [], {"hard": -0.1}, "hard must lie between 0 and 1, got -0.1"),
        ("dagger", [], {"violation": "dear"}, "violation must lie between 0 and 1e+06, got 'dear'"),
        ("dagger", [], {"learning_rate": 0}, "learning_rate must lie between 0 and 1, got 0"),
        ("dagger", [], {"learning_rate": "lin_2"}, "learning_rate must lie between 0 and 1, got"),
        ("dagger", [], {"gamma": 0.9}, "unknown keys 'gamma'; known are n_envs"),
        ("dagger", ["--seed", str(2**32)], {}, "dagger takes seeds up to 4294967295, got"),
        ("dagger", [], {"policy_kwargs": {"components": 0}}, "components must be a whole number"),
        (
            "dagger",
            [],
            {"env_kwargs": {"observation": "rays"}},
            "this policy needs obstacles in the observation",
        ),
        ("bc", [], {}, "bc learns from demonstrations: name them with --demos DATASET_ID"),
        ("bc", ["--demos", "some/none-v0"], {}, "--demos some/none-v0 holds no flights to learn"),
    ],
)
@pytest.mark.usefixtures("demos")
def test_what_makes_no_sense_is_refused_before_anything_is_written(
    algorithm: str,
    more: list[str],
    changes: dict,
    match: str,
    command: Command,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(command(algorithm, *more, **changes)) == 2
    error = capsys.readouterr().err
    assert match in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_models_of_another_kind_are_no_beginning(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = saved(tmp_path / "start", card_of("sac"))
    assert main(command("dagger", "--from", str(start))) == 2
    assert "dagger cannot go on with a model of sac" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_configuration_tells_trainings_apart(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("dagger")) == 0
    assert main(command("dagger", hard=0.5)) == 2
    assert "hyperparameters.learner.hard" in capsys.readouterr().err
    told = json.loads((tmp_path / "out/run.json").read_text())
    assert told["hyperparameters"]["learner"]["updates"] == TINY["updates"]
