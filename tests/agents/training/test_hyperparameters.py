"""Hyperparameters from files, and schedules that follow the budget of a training."""

import json
from pathlib import Path

import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

from agents.demonstrations import reading
from agents.models import shipped_agents
from agents.training import ALGORITHMS
from agents.training.budget import LinearSchedule, TrainingBudget
from agents.training.hyperparameters import SHIPPED, read
from agents.training.run import Run
from ferguson_gym import ENVIRONMENT_ID
from tests.support.tiny_imitation import straight_flights


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("a: [", "not YAML"),
        ("!!float ''", r"not YAML \(string index out of range\)"),
        ("2020-99-99", r"not YAML \(month must be in 1..12\)"),
        ("&a [*a, *a]", "need the key ferguson/ObstacleField-v0 at the top"),
        (
            f"{ENVIRONMENT_ID}: {{n_envs: 1, n_timesteps: 1, eval_freq: 1, policy: mlp, "
            "policy_kwargs: {net_arch: &a [*a, *a]}}",
            "maximum recursion depth",
        ),
        ("a: 1\n" * 30_000, r"not YAML \(more than 100,000 bytes\)"),
        ("[" * 100_000, r"not YAML \(nested more than 50 deep\)"),
        ("!!python/object/apply:os.system ['true']", "not YAML"),
        ("CartPole-v1: {}", f"need the key {ENVIRONMENT_ID} at the top"),
        (f"{ENVIRONMENT_ID}: 3", "need keys and values below"),
        (f"{ENVIRONMENT_ID}: {{policy: mlp}}", "missing keys n_timesteps"),
        (
            f"{ENVIRONMENT_ID}: {{n_timesteps: 9, policy: mlp, fields: forest/train:1}}",
            "fields must be a list of names, got 'forest/train:1'",
        ),
    ],
)
def test_files_without_valid_hyperparameters_are_refused(
    text: str, match: str, tmp_path: Path
) -> None:
    (tmp_path / "recipe.yml").write_text(text)
    with pytest.raises(ValueError, match=match):
        read(str(tmp_path / "recipe.yml"), ALGORITHMS["ppo"].keys)


def test_a_schedule_follows_the_limit_that_comes_first() -> None:
    by_steps, by_time = TrainingBudget(100, None, steps=25), TrainingBudget(None, 1.0, seconds=45.0)
    assert LinearSchedule(4.0, by_steps)(0.0) == 3.0
    assert LinearSchedule(4.0, by_time)(1.0) == pytest.approx(1.0, abs=0.1)
    assert not by_time.time_is_up
    assert TrainingBudget(100, 1.0, steps=10, seconds=61.0).time_is_up
    assert TrainingBudget(100, 1.0, steps=10, seconds=61.0).done == 1.0


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.yml")), ids=lambda file: file.stem)
def test_shipped_hyperparameters_are_valid(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    algorithm = ALGORITHMS[file.stem.partition("-")[0]]
    recipe = read(file.stem, algorithm.keys)
    run = Run(
        algorithm=file.stem.partition("-")[0],
        directory=tmp_path / "out",
        hyperparameters=recipe,
        demos="some/pursuit-v0" if file.stem.startswith("bc") else None,
        start=shipped_agents.SHIPPED / "dagger" if file.stem == "ppo-refining" else None,
    )
    monkeypatch.setattr(reading, "read", lambda _: straight_flights(tmp_path))
    algorithm.trainer().prepare(run)
    assert not (tmp_path / "out").exists()
    json.dumps(run.configuration())
