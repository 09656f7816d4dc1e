"""Imitation as `ferguson train` runs it: results do not depend on workers, threads or process."""

import json
import os
import shutil
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import torch
import yaml

from agents.cli.main import main
from agents.flights.batched import fly_batch
from agents.flights.metrics import score
from agents.models import loading
from agents.training.imitation import dagger_rollouts
from agents.training.imitation.behavior_cloning import BehaviorCloning
from agents.training.imitation.dagger_rollouts import RolloutRequest, Rollouts
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.world.field_names import get_fields
from tests.support.small_models import card_of, same, saved, weights_of
from tests.support.tiny_imitation import CHOSEN, REPORTED, TINY, Command, curve_of

COLLECT = dagger_rollouts.collect


def test_dagger_writes_a_model_its_card_and_its_curve(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("dagger", "--seed", "3")) == 0
    out = tmp_path / "out"
    names = {"model.zip", "model.json", "run.json", "curve.csv", "progress.json"}
    names |= {"best", "tensorboard"}
    assert {path.name for path in out.iterdir()} == names
    model = loading.load(out)
    card = model.card
    assert (card.algorithm, card.policy, card.seed) == ("dagger", "deepsets-mixture", 3)
    assert card.environment == TINY["env_kwargs"]
    progress = json.loads((out / "progress.json").read_text())
    assert (progress["status"], progress["model"]) == ("finished", str(out))
    assert progress["validation"]["steps"] == progress["steps"] == card.curve[-1]["steps"]
    steps = [row["steps"] for row in card.curve]
    assert steps == sorted(set(steps))
    assert len(steps) > 2
    assert steps[-1] >= 300
    for key, spec in (("chosen_on", CHOSEN), ("reported_on", REPORTED)):
        assert card.results[key]["spl"] == score(fly_batch(model, get_fields(spec))).spl
    assert "SPL" in capsys.readouterr().out
    # the same command has nothing left to do
    assert main(command("dagger", "--seed", "3")) == 0
    assert "is already finished" in capsys.readouterr().err


def test_the_losses_of_dagger_decrease(command: Command, tmp_path: Path) -> None:
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
    # violations begin near zero, where experts fly and untrained networks go straight on
    assert np.isfinite([cost["violation"] for cost in costs]).all()


def test_the_same_seed_gives_the_same_model(command: Command, tmp_path: Path) -> None:
    found = []
    for seed in ("0", "0", "1"):
        assert main(command("dagger", "--seed", seed, "--fresh")) == 0
        found.append(weights_of(tmp_path / "out"))
    assert same(found[0], found[1])
    assert not same(found[0], found[2])


@pytest.mark.parametrize("threads", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_the_number_of_workers_does_not_change_the_weights(
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


def killed_once(mark: Path, request: RolloutRequest) -> Rollouts:
    """Rollouts; in the middle of a round, the worker process is killed at the first try."""
    _, rounds, share = request.stream
    if (rounds, share) == (2, 3) and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return COLLECT(request)


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
@pytest.mark.filterwarnings("default:a worker process died")
def test_a_killed_worker_is_reported_and_does_not_change_the_weights(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(command("dagger")) == 0
    whole = weights_of(tmp_path / "out"), curve_of(tmp_path / "out")
    capsys.readouterr()
    monkeypatch.setattr(dagger_rollouts, "collect", partial(killed_once, tmp_path / "mark"))
    assert main(command("dagger", "--workers", "2", "--fresh", "--quiet")) == 0
    assert (tmp_path / "mark").exists()
    error = capsys.readouterr().err
    assert error.startswith("ferguson: warning: a worker process died (SIGKILL(-9))")
    assert error.count("\n") == 1
    assert curve_of(tmp_path / "out") == whole[1]
    assert same(weights_of(tmp_path / "out"), whole[0])


@pytest.mark.usefixtures("demos")
def test_bc_learns_from_demonstrations_and_dagger_and_ppo_start_from_its_model(
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
    # and PPO starts from either
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
        ("dagger", [], {"updates": 0}, "updates must be an integer >= 1, got 0"),
        ("dagger", [], {"updates": True}, "updates must be an integer >= 1, got True"),
        ("dagger", [], {"first": 1.5}, "first must be an integer >= 1, got 1.5"),
        ("dagger", [], {"batch_size": "all"}, "batch_size must be an integer >= 1, got"),
        ("dagger", [], {"scattered": 1.1}, "scattered must lie between 0 and 1, got 1.1"),
        ("dagger", [], {"scattered": True}, "scattered must lie between 0 and 1, got True"),
        ("dagger", [], {"hard": -0.1}, "hard must lie between 0 and 1, got -0.1"),
        ("dagger", [], {"violation": "dear"}, "violation must lie between 0 and 1e+06, got 'dear'"),
        ("dagger", [], {"learning_rate": 0}, "learning_rate must lie between 0 and 1, got 0"),
        ("dagger", [], {"learning_rate": "lin_2"}, "learning_rate must lie between 0 and 1, got"),
        ("dagger", [], {"gamma": 0.9}, "unknown keys 'gamma'; known are n_envs"),
        ("dagger", ["--seed", str(2**32)], {}, "dagger takes seeds up to 900719924, got"),
        ("dagger", [], {"policy_kwargs": {"components": 0}}, "components must be an integer"),
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
def test_invalid_runs_are_refused_before_anything_is_written(
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


def test_a_model_with_other_networks_is_refused_as_a_start(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = saved(tmp_path / "start", card_of("tqc"))
    assert main(command("dagger", "--from", str(start))) == 2
    assert "dagger cannot start from a model of tqc" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_another_configuration_in_the_same_directory_is_refused(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("dagger")) == 0
    assert main(command("dagger", hard=0.5)) == 2
    assert "hyperparameters.learner.hard" in capsys.readouterr().err
    recorded = json.loads((tmp_path / "out/run.json").read_text())
    assert recorded["hyperparameters"]["learner"]["updates"] == TINY["updates"]
