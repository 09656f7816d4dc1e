"""PPO whose noise decreases on a schedule."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from stable_baselines3 import PPO

from agents.cli.main import main
from ferguson_gym import ENVIRONMENT_ID

FIRST, LAST = -1.0, 0.01
RECIPE: dict[str, Any] = {
    "n_envs": 2,
    "n_timesteps": 96,
    "eval_freq": 96,
    "policy": "mlp",
    "policy_kwargs": {"net_arch": [4], "log_std_init": FIRST},
    "env_kwargs": {"observation": "rays", "rays": 5, "suite": "sparse"},
    "n_steps": 4,
    "batch_size": 4,
    "n_epochs": 1,
    "last_std": LAST,
}


def line(directory: Path, **changes: Any) -> list[str]:
    config = directory / "config.yml"
    config.write_text(yaml.safe_dump({ENVIRONMENT_ID: RECIPE | changes}))
    where = ["--config", str(config), "--out", str(directory / "out")]
    chosen = ["--choose-on", "sparse/validation:0", "--report-on", "sparse/validation:1"]
    return ["train", "ppo", *where, *chosen]


@pytest.mark.parametrize("last", [0, -0.1, 2.0, True, "lin_0.1"])
def test_impossible_noise_is_refused(
    last: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line(tmp_path, last_std=last)) == 2
    assert f"last_std must lie between 0 and 1, got {last!r}" in capsys.readouterr().err


def test_a_mixture_s_noise_has_no_schedule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line(tmp_path, policy="mlp-mixture")) == 2
    assert "mlp-mixture learns its noise in each state" in capsys.readouterr().err


def test_the_noise_falls_by_the_same_factor_in_every_rollout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noises: list[list[float]] = []
    train = PPO.train

    def watched(model: PPO) -> None:
        noises.append(model.policy.log_std.tolist())
        train(model)

    monkeypatch.setattr(PPO, "train", watched)
    assert main(line(tmp_path)) == 0
    assert len(noises) == 12
    for rollout, noise in enumerate(noises):
        done = rollout / 12
        expected = (1.0 - done) * FIRST + done * math.log(LAST)
        assert noise == pytest.approx([expected] * 4, abs=1e-6)
