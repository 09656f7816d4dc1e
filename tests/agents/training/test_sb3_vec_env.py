"""The `VecEnv` equals the library's `DummyVecEnv` of scalar environments."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import FlattenObservation

from ferguson_gym.environment import ObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from agents.training.sb3_vec_env import ObstacleFieldVecEnv

NUMBER = 4
ARGUMENTS: dict[str, Any] = {
    "suite": "sparse",
    "fields": 30,
    "segments": 5,
    "gate": 2.0,
    "capacity": 50,
}
KINDS: dict[str, dict] = {
    "discs": {"observation": "discs", "nearest": 5},
    "rays": {"observation": "rays", "rays": 11},
    "way": {"rays": 5, "way": 3, "progress": "way", "reference": True},
}
NEAR = Field(name="near", obstacles=Obstacles.discs([], []), goal=[6.5, 6.5])


def pair(flat: bool, number: int = NUMBER, **arguments: Any) -> tuple:
    """The adapter and what it stands for."""
    arguments = {**ARGUMENTS, **arguments}

    def scalar() -> gym.Env:
        env = ObstacleField(**arguments)
        return FlattenObservation(env) if flat else env

    return ObstacleFieldVecEnv(number, flat=flat, **arguments), DummyVecEnv([scalar] * number)


def drawn(stream: np.random.Generator, number: int = NUMBER) -> np.ndarray:
    spread = stream.choice([0.0, 0.05, 0.3], (number, 1))
    return (stream.uniform(-1.0, 1.0, (number, 4)) * spread).astype(np.float32)


def assert_same(mine: Any, theirs: Any) -> None:
    """Equal in structure, type and every bit."""
    if isinstance(theirs, dict):
        assert isinstance(mine, dict)
        assert set(mine) == set(theirs)
        for key, value in theirs.items():
            assert_same(mine[key], value)
    elif isinstance(theirs, (list, tuple)):
        assert len(mine) == len(theirs)
        for one, other in zip(mine, theirs, strict=True):
            assert_same(one, other)
    elif isinstance(theirs, np.ndarray):
        assert isinstance(mine, np.ndarray)
        assert mine.dtype == theirs.dtype
        np.testing.assert_array_equal(mine, theirs)
    else:
        assert type(mine) is type(theirs)
        assert mine == theirs


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("flat", [False, True])
def test_steps_equal_those_of_a_dummy_vec_env(flat: bool, kind: str) -> None:
    mine, theirs = pair(flat, **KINDS[kind])
    for space in ("observation_space", "action_space"):
        assert getattr(mine, space) == getattr(theirs, space)
    stream, ends = np.random.default_rng(0), {"success": 0, "cut": 0, "failure": 0}
    for options in (None, {"field": NEAR}, [{}, {"field": NEAR}, {"field": "paper:2"}, {}]):
        for envs in (mine, theirs):
            assert list(envs.seed(7)) == [7, 8, 9, 10]
            envs.set_options(options)
        assert_same(mine.reset(), theirs.reset())
        assert_same(mine.reset_infos, theirs.reset_infos)
        for _ in range(70):
            actions = drawn(stream)
            results = mine.step(actions)
            assert_same(results, theirs.step(actions))
            assert_same(mine.reset_infos, theirs.reset_infos)
            _, _, dones, infos = results
            for done, info in zip(dones, infos, strict=True):
                assert done == ("terminal_observation" in info)
                ends["success"] += info["is_success"]
                ends["cut"] += info["TimeLimit.truncated"]
                ends["failure"] += done and not info["TimeLimit.truncated"]
        # seeds and options are used up by one reset
        assert_same(mine.reset(), theirs.reset())
    assert min(ends.values()) >= 3


def test_the_library_s_maker_of_environments_is_refused_with_what_to_call() -> None:
    message = r"make_vec_env does not apply to it; call VecMonitor\(ObstacleFieldVecEnv\(3, "
    with pytest.raises(TypeError, match=message):
        make_vec_env("ferguson/ObstacleField-v0", 3, vec_env_cls=ObstacleFieldVecEnv)


def test_returned_arrays_are_not_overwritten() -> None:
    mine, theirs = pair(flat=False)
    for envs in (mine, theirs):
        envs.seed(1)
    kept = [(mine.reset(), theirs.reset())]
    stream = np.random.default_rng(3)
    for _ in range(40):
        actions = drawn(stream)
        kept.append((mine.step(actions), theirs.step(actions)))
    for one, other in kept:
        assert_same(one, other)


def test_unknown_options_are_refused() -> None:
    envs = ObstacleFieldVecEnv(2, **ARGUMENTS)
    envs.set_options({"wind": 1})
    with pytest.raises(ValueError, match=r"unknown reset options \['wind'\]"):
        envs.reset()
    envs.set_options([{}, {"field": 7}])
    with pytest.raises(ValueError, match="must be a Field or the name of one, got int"):
        envs.reset()


def test_actions_are_checked() -> None:
    envs = ObstacleFieldVecEnv(2, **ARGUMENTS)
    envs.reset()
    with pytest.raises(ValueError, match=r"action must have shape \(2, 4\), got \(4,\)"):
        envs.step(np.zeros(4))
    with pytest.raises(ValueError, match=r"action \(environment 1\) must be finite"):
        envs.step(np.array([[0.0] * 4, [np.nan] * 4]))


@pytest.mark.parametrize("flat", [False, True])
def test_wrappers_of_the_library_work(flat: bool) -> None:
    pairs = pair(flat)
    seen, summaries = [], []
    for envs in pairs:
        wrapped = VecNormalize(VecMonitor(envs, info_keywords=("is_success",)), clip_obs=5.0)
        wrapped.seed(2)
        results: list = [wrapped.reset()]
        stream = np.random.default_rng(2)
        results += [wrapped.step(drawn(stream)) for _ in range(40)]
        infos = [info for step in results[1:] for info in step[3]]
        episodes = [info.pop("episode") for info in infos if "episode" in info]
        assert len(episodes) > 10
        summaries.append([(e["r"], e["l"], e["is_success"]) for e in episodes])
        seen.append(results)
    assert summaries[0] == summaries[1]
    assert_same(*seen)


def test_attributes_and_methods() -> None:
    envs = ObstacleFieldVecEnv(3, **ARGUMENTS)
    envs.seed(5)
    envs.reset()
    names = ["sparse/train:5", "sparse/train:6", "sparse/train:7"]
    assert [field.name for field in envs.get_attr("field")] == names
    assert [field.name for field in envs.env_method("field")] == names
    assert [field.name for field in envs.env_method("field", indices=[2, 0])] == names[::-2]
    assert envs.get_attr("field", 1)[0].name == names[1]
    assert [state.segments for state in envs.get_attr("state")] == [0, 0, 0]
    assert [len(control) for control in envs.get_attr("control", [0, 1])] == [0, 0]
    assert envs.get_attr("refused") == [None] * 3
    assert envs.get_attr("render_mode") == [None] * 3
    assert envs.get_attr("settings", [1])[0].suite == "sparse"
    for name, expected in (
        ("observation_space", envs.observation_space),
        ("action_space", envs.action_space),
        ("np_random_seed", None),
    ):
        given = envs.get_attr(name)
        assert len(given) == 3
        assert given == ([5, 6, 7] if expected is None else [expected] * 3)
    assert envs.env_is_wrapped(Monitor) == [False] * 3
    assert envs.env_is_wrapped(Monitor, indices=1) == [False]
    with pytest.raises(AttributeError, match="wind"):
        envs.get_attr("wind")
    with pytest.raises(AttributeError, match="nearest cannot be set; make a new ObstacleFieldVec"):
        envs.set_attr("nearest", 3)
    with pytest.raises(
        AttributeError, match=r"no method 'steer' .*; methods are set_arguments, fi"
    ):
        envs.env_method("steer")


def test_arguments_change_as_those_of_a_dummy_vec_env() -> None:
    arguments = {"obstacles": 10, "failure": 1.0}
    mine, theirs = pair(flat=False, **arguments)
    stream, names = np.random.default_rng(0), set()
    for envs in (mine, theirs):
        envs.seed(3)
        envs.reset()
    for k in range(100):
        for envs in (mine, theirs):
            if k == 10:
                envs.set_attr("obstacles", 30)
            if k == 30:
                envs.set_attr("obstacles", 0, indices=[0, 2])
                envs.env_method("set_arguments", failure=3.0, gate=0.5, indices=1)
            if k == 60:
                envs.env_method("set_arguments", obstacles=None, fields=["paper:1", NEAR])
            if k == 80:
                envs.set_options([{"segments": 2}, {}, {"field": NEAR, "detour": 1.0}, {}])
        if k == 80:
            assert_same(*(envs.reset() for envs in (mine, theirs)))
        actions = drawn(stream)
        assert_same(*(envs.step(actions) for envs in (mine, theirs)))
        assert mine.get_attr("failure") == theirs.get_attr("failure")
        names |= {field.name.partition(", ")[2] for field in mine.get_attr("field")}
    assert names >= {"10 obstacles", "30 obstacles", "0 obstacles"}
    assert {field.name for field in mine.get_attr("field")} <= {"paper:1", "near"}


def test_rendering_and_closing() -> None:
    envs = ObstacleFieldVecEnv(2, render_mode="rgb_array", **ARGUMENTS)
    envs.seed(0)
    envs.reset()
    images = envs.get_images()
    assert [image.shape for image in images] == [(800, 800, 3)] * 2
    assert envs.render("rgb_array").shape == (1600, 800, 3)
    envs.close()
    envs.close()


@pytest.mark.parametrize(("flat", "policy"), [(False, "MultiInputPolicy"), (True, "MlpPolicy")])
def test_an_agent_trains_on_it(flat: bool, policy: str) -> None:
    from stable_baselines3 import PPO

    envs = ObstacleFieldVecEnv(8, flat=flat, observation="rays", **ARGUMENTS)
    model = PPO(policy, VecMonitor(envs), n_steps=16, batch_size=32, n_epochs=1, seed=0)
    model.learn(256)
    assert model.num_timesteps == 256
    assert len(model.ep_info_buffer) > 10
    action, _ = model.predict(envs.reset(), deterministic=True)
    assert envs.action_space.contains(action[0])


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="num_envs must be an integer >= 1, got 0"):
        ObstacleFieldVecEnv(0)
    with pytest.raises(TypeError, match="unexpected keyword argument 'wind'; known are suite"):
        ObstacleFieldVecEnv(2, wind=3)
    with pytest.raises(TypeError, match="unexpected keyword argument 'autoreset_mode'; known"):
        ObstacleFieldVecEnv(2, autoreset_mode="NextStep")
