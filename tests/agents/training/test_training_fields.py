"""`ferguson train --fields`: flights go through fields of one's own."""

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import yaml

from agents.cli.main import main
from agents.models import loading
from agents.training.imitation import dagger_rollouts
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym import ENVIRONMENT_ID
from tests.support import tiny_imitation

OWN = {"centers": [[50.0, 20.0]], "radii": [3.0]}
PPO: dict[str, Any] = {
    "n_envs": 2,
    "n_timesteps": 16,
    "eval_freq": 16,
    "policy": "mlp",
    "policy_kwargs": {"net_arch": [4]},
    "env_kwargs": {"observation": "rays", "rays": 5, "fields": 20},
    "n_steps": 4,
    "batch_size": 4,
    "n_epochs": 1,
}


def line(tmp_path: Path, algorithm: str, recipe: dict[str, Any], *more: str) -> list[str]:
    (tmp_path / "own.json").write_text(json.dumps(OWN))
    (tmp_path / "config.yml").write_text(yaml.safe_dump({ENVIRONMENT_ID: recipe}))
    names = ["--fields", "forest/train:3-4", "--fields", str(tmp_path / "own.json")]
    where = ["--config", str(tmp_path / "config.yml"), "--out", str(tmp_path / "out")]
    chosen = ["--choose-on", "sparse/validation:0", "--report-on", "sparse/validation:1"]
    return ["train", algorithm, *names, *where, *chosen, *more]


def test_reinforcement_learning_flies_them_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: set[str] = set()
    step = ObstacleFieldVecEnv.step_wait

    def watched(envs: ObstacleFieldVecEnv) -> Any:
        flown.update(field.name for field in envs.env_method("field"))
        return step(envs)

    monkeypatch.setattr(ObstacleFieldVecEnv, "step_wait", watched)
    recipe = PPO | {"n_timesteps": 96}
    assert main(line(tmp_path, "ppo", recipe)) == 0
    assert flown == {"forest/train:3", "forest/train:4", "own"}
    card = loading.load(tmp_path / "out").card
    assert card.environment == PPO["env_kwargs"]
    assert card.settings["fields"] == ["forest/train:3-4", str(tmp_path / "own.json")]


def test_imitation_labels_states_in_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flown: set[str] = set()
    rollouts = dagger_rollouts.SimulatedRollouts

    def watched(fields: Any, *others: Any) -> Any:
        flown.update(field.name for field in fields)
        return rollouts(fields, *others)

    monkeypatch.setattr(dagger_rollouts, "SimulatedRollouts", watched)
    assert main(line(tmp_path, "dagger", tiny_imitation.TINY)) == 0
    assert flown == {"forest/train:3", "forest/train:4", "own"}


def test_hyperparameters_may_name_them(tmp_path: Path) -> None:
    recipe = PPO | {"fields": ["forest/train:3-4", "traps/train:7"]}
    given = line(tmp_path, "ppo", recipe)
    named = [part for k, part in enumerate(given) if "--fields" not in given[max(k - 1, 0) : k + 1]]
    assert main(named) == 0
    settings = loading.load(tmp_path / "out").card.settings
    assert settings["fields"] == recipe["fields"]
    assert "fields" not in settings["hyperparameters"]
    assert main([*given, "--fresh"]) == 0  # the command line comes first
    settings = loading.load(tmp_path / "out").card.settings
    assert settings["fields"] == ["forest/train:3-4", str(tmp_path / "own.json")]


def test_a_model_is_chosen_on_fields_of_several_names(tmp_path: Path) -> None:
    several = ["sparse/validation:0-1", "forest/validation:3"]
    given = line(tmp_path, "ppo", PPO | {"choose_on": several})
    assert main(given) == 0  # the command line comes first
    assert loading.load(tmp_path / "out").card.results["chosen_on"]["fields"] == given[-3]
    without = [*given[:-4], *given[-2:], "--fresh"]
    assert main(without) == 0
    chosen = loading.load(tmp_path / "out").card.results["chosen_on"]
    assert (chosen["fields"], chosen["flights"]) == (",".join(several), 3)


def test_other_fields_are_another_training(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line(tmp_path, "ppo", PPO)) == 0
    capsys.readouterr()
    assert main(line(tmp_path, "ppo", PPO, "--fields", "paper:1")) == 2
    assert "fields was" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("algorithm", "more", "match"),
    [
        ("ppo", ("--fields", "nowhere/train:1"), "nowhere"),
        ("bc", ("--demos", "some/thing-v0"), "bc flies no fields"),
    ],
)
def test_fields_that_cannot_be_flown_are_refused(
    algorithm: str,
    more: tuple[str, ...],
    match: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    recipe = PPO if algorithm == "ppo" else tiny_imitation.TINY
    assert main(line(tmp_path, algorithm, recipe, *more)) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert match in error
    assert not (tmp_path / "out").exists()
