"""Our files in the RL Zoo, and the Zoo's files here."""

import inspect
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import yaml
from stable_baselines3.common.env_util import make_vec_env

from agents.training import ALGORITHMS
from agents.training.hyperparameters import SHIPPED, read
from agents.training.run import Run
from agents.training.sb3 import _LEARNERS, card_for
from ferguson_gym import ENVIRONMENT_ID
from tests.support.places import ROOT
from tests.support.small_models import learned

OF_THE_ZOO = {"n_envs", "n_timesteps", "env_kwargs"}
"""Keys that the Zoo takes for itself; the others go to the algorithm."""
PPO_OF_THE_ZOO = """
default:
  n_timesteps: !!float 1e6
  policy: 'MlpPolicy'

Pendulum-v1:
  policy: 'CnnPolicy'

{environment}:
  normalize: true
  frame_stack: {frames}
  env_wrapper:
    - stable_baselines3.common.atari_wrappers.AtariWrapper
  n_envs: 8
  n_timesteps: !!float 1e6
  policy: 'MlpPolicy'
  n_steps: 32
  learning_rate: lin_0.001
  clip_range: lin_0.2
  use_sde: {sde}
  policy_kwargs: >
    dict(log_std_init=-3.29, net_arch=dict(pi=[64], vf=(32, 8)), activation_fn=nn.ReLU)
"""


def file_of(tmp_path: Path, text: str) -> str:
    (tmp_path / "zoo.yml").write_text(text)
    return str(tmp_path / "zoo.yml")


def test_a_file_of_the_zoo_is_read_and_what_has_no_like_is_named_in_one_line(
    tmp_path: Path,
) -> None:
    text = PPO_OF_THE_ZOO.format(environment=ENVIRONMENT_ID, frames=4, sde=True)
    with pytest.warns(UserWarning, match="RL Zoo") as said:
        found = read(file_of(tmp_path, text), ALGORITHMS["ppo"].keys)
    assert [str(one.message) for one in said] == [
        "ignored the RL Zoo's env_wrapper, frame_stack, normalize, use_sde: ferguson train has "
        "nothing like it"
    ]
    assert (found.n_envs, found.n_timesteps, found.eval_freq) == (8, 1_000_000, 20_000)
    assert found.policy == "mlp"
    assert found.policy_kwargs == {
        "log_std_init": -3.29,
        "net_arch": {"pi": [64], "vf": [32, 8]},
        "activation_fn": "relu",
    }
    assert found.learner == {"n_steps": 32, "learning_rate": "lin_0.001", "clip_range": "lin_0.2"}
    run = Run(algorithm="ppo", directory=tmp_path, hyperparameters=found)
    assert card_for(run, None).policy_kwargs == found.policy_kwargs  # the network can be built


def test_keys_that_are_off_are_not_mentioned(tmp_path: Path) -> None:
    text = f"{ENVIRONMENT_ID}: {{n_timesteps: 100, policy: MlpPolicy, normalize: false, "
    text += "frame_stack: 1, use_sde: False, sde_sample_freq: -1, env_wrapper: null}"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read(file_of(tmp_path, text), ALGORITHMS["ppo"].keys)
    assert (found.n_envs, found.eval_freq, found.policy) == (1, 2, "mlp")


def test_an_environment_that_is_not_listed_has_the_defaults(tmp_path: Path) -> None:
    text = "default: {n_timesteps: 1e6, policy: MlpPolicy, tau: 0.02}"
    found = read(file_of(tmp_path, text), ALGORITHMS["tqc"].keys)
    assert found.n_timesteps == 1_000_000
    assert found.learner == {"tau": 0.02}


def test_noise_that_the_zoo_adds_to_actions_is_ignored_and_named(tmp_path: Path) -> None:
    text = "default: {n_timesteps: 100, policy: MlpPolicy, noise_type: normal, noise_std: 0.1}"
    with pytest.warns(UserWarning, match=r"ignored the RL Zoo's noise_std, noise_type: "):
        found = read(file_of(tmp_path, text), ALGORITHMS["tqc"].keys)
    assert found.learner == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "{eval_freq: 5}\nferguson: {eval_freq: 6}",
            "eval_freq stands below .* and below ferguson",
        ),
        ("{}\nferguson: 3", "need keys and values below ferguson"),
        ("{n_timesteps: 1, policy: CnnPolicy}", None),
        ("{n_timesteps: 1, policy: mlp, policy_kwargs: exit(3)}", "or be dict.KEY=VALUE"),
        ("{n_timesteps: 1, policy: mlp, policy_kwargs: 'dict(a=exit(3))'}", "got .*exit"),
        ("{n_timesteps: 1, policy: mlp, policy_kwargs: 'dict(**{1: 2})'}", "or be dict"),
        ("{n_timesteps: 1, policy: mlp, policy_kwargs: 'dict(a=1'}", "or be dict"),
        (f"{{n_timesteps: 1, policy: mlp, policy_kwargs: '{'(' * 5000}'}}", "or be dict"),
    ],
)
def test_what_is_wrong_in_such_a_file_is_named(
    text: str, message: str | None, tmp_path: Path
) -> None:
    place = file_of(tmp_path, f"{ENVIRONMENT_ID}: {text}")
    if message is None:
        run = Run(algorithm="ppo", directory=tmp_path, hyperparameters=read(place, []))
        with pytest.raises(ValueError, match="unknown policy 'CnnPolicy'; policies are mlp"):
            card_for(run, None)
        return
    with pytest.raises(ValueError, match=message):
        read(place, ALGORITHMS["ppo"].keys)


def test_a_run_observes_what_the_model_observes_that_it_starts_from(tmp_path: Path) -> None:
    seen = {"observation": "rays", "rays": 5, "way": 2, "margin": 1.5}
    place = file_of(
        tmp_path,
        f"{ENVIRONMENT_ID}: {{n_timesteps: 1, policy: mlp, "
        "env_kwargs: {rays: 9, way: 4, margin: 0.1, progress: way}}",
    )
    run = Run(algorithm="ppo", directory=tmp_path, hyperparameters=read(place, []))
    start = learned("ppo", seen)
    assert card_for(run, start).environment == {**seen, "progress": "way"}


@pytest.mark.parametrize("algorithm", ["ppo", "tqc"])
def test_what_the_zoo_reads_of_our_files_builds_the_algorithm(algorithm: str) -> None:
    content = yaml.safe_load((SHIPPED / f"{algorithm}.yml").read_text())
    given: dict[str, Any] = content[ENVIRONMENT_ID]
    own = {key: value for key, value in given.items() if key not in OF_THE_ZOO}
    learner = _LEARNERS[algorithm]
    assert set(own) <= set(inspect.signature(learner).parameters)
    own |= {"learning_rate": float(own["learning_rate"].removeprefix("lin_"))}
    own |= {"buffer_size": 10} if "buffer_size" in own else {}
    env = make_vec_env(ENVIRONMENT_ID, 16, env_kwargs=given["env_kwargs"])
    assert learner(env=env, device="cpu", **own).n_envs == 16


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_zoo_trains_on_our_file(tmp_path: Path) -> None:
    pytest.importorskip("rl_zoo3", reason="the RL Zoo is not installed (docs/recipes.md)")
    line = ["--algo", "ppo", "--env", ENVIRONMENT_ID, "--gym-packages", "ferguson_gym"]
    line += ["--conf-file", str(SHIPPED / "ppo.yml"), "-n", "8192", "--eval-freq", "-1"]
    subprocess.run(
        [sys.executable, "-m", "rl_zoo3.train", *line, "--log-folder", str(tmp_path)],
        check=True,
        cwd=ROOT,
    )
    assert len(list(tmp_path.glob("ppo/ferguson-ObstacleField-v0_1/*.zip"))) == 1
