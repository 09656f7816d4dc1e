"""The vector environment's contract with Gymnasium: making, spaces, wrappers, checkers."""

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import FlattenObservation, TimeAwareObservation
from gymnasium.wrappers import vector as wrappers

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome

BACK = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
"""A segment that is refused."""
OPEN = Field(name="open", obstacles=Obstacles.discs([], []), start=[50.0, 50.0])
LEFT = np.array([-0.3, 0.3, 0.0, 0.0], np.float32)
"""A segment of a circle that stays inside the bounds."""
NEXT_STEP, SAME_STEP, DISABLED = (
    AutoresetMode.NEXT_STEP,
    AutoresetMode.SAME_STEP,
    AutoresetMode.DISABLED,
)
EVERY_ARGUMENT: dict[str, Any] = {
    "suite": "dense",
    "split": "validation",
    "fields": 5,
    "obstacles": 33,
    "radii": (2.0, 4.0),
    "gate": 2.5,
    "segments": 17,
    "observation": "rays",
    "nearest": 3,
    "focus": 4.0,
    "rays": 9,
    "way": 2,
    "margin": 0.5,
    "progress": "way",
    "reference": True,
    "detour": 0.5,
    "failure": 2.0,
    "capacity": 60,
}
OBSERVATIONS: list[dict] = [
    {"observation": "discs", "nearest": 1},
    {"observation": "discs", "focus": 10.0},
    {"observation": "rays", "rays": 1},
    {"observation": "rays"},
    {"rays": 3, "way": 7},
]


@pytest.mark.parametrize("arguments", [{}, EVERY_ARGUMENT], ids=["usual", "every argument"])
@pytest.mark.parametrize("number", [1, 3])
def test_make_by_name_and_again_from_the_spec(arguments: dict, number: int) -> None:
    envs = gym.make_vec(
        ENVIRONMENT_ID, num_envs=number, autoreset_mode="Disabled", render_mode=None, **arguments
    )
    assert isinstance(envs.unwrapped, VectorObstacleField)
    assert envs.spec is not None
    again = gym.make_vec(envs.spec)
    assert again.num_envs == number
    assert again.unwrapped.settings == envs.unwrapped.settings
    single = gym.make(ENVIRONMENT_ID, **arguments).observation_space
    for one in (envs, again):
        assert one.metadata["autoreset_mode"] is DISABLED
        assert one.single_observation_space == single
        assert one.observation_space == batch_space(single, number)
        assert one.single_action_space == gym.spaces.Box(-1.0, 1.0, (4,), np.float32)
        assert one.action_space.shape == (number, 4)
    first, second = envs.reset(seed=4)[0], again.reset(seed=4)[0]
    assert envs.unwrapped.field(0).name == again.unwrapped.field(0).name
    assert envs.observation_space.contains(first)
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key])


def test_a_spec_makes_the_scalar_environment_again_with_every_argument() -> None:
    env = gym.make(ENVIRONMENT_ID, **EVERY_ARGUMENT)
    assert env.spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert env.unwrapped.settings.radii == (2.0, 4.0)
    for name, value in EVERY_ARGUMENT.items():
        for one in (env, again):
            given = getattr(one.unwrapped.settings, name)
            assert (tuple(given) if name == "radii" else given) == value
    (first, _), (second, _) = env.reset(seed=4), again.reset(seed=4)
    assert env.unwrapped.field.name == again.unwrapped.field.name
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key])


@pytest.mark.parametrize("arguments", [{}, {"segments": 7}, {"segments": 60}])
def test_the_spec_says_after_how_many_steps_flights_are_truncated(arguments: dict) -> None:
    steps = arguments.get("segments", 40)
    env = gym.make(ENVIRONMENT_ID, **arguments)
    envs = gym.make_vec(ENVIRONMENT_ID, num_envs=2, **arguments)
    assert env.spec.max_episode_steps == envs.spec.max_episode_steps == steps
    assert gym.spec(ENVIRONMENT_ID).max_episode_steps is None  # no second limit around the first
    for again in (gym.make_vec(envs.spec), gym.make_vec(env.spec, num_envs=2)):
        assert again.unwrapped.settings == envs.unwrapped.settings
        assert again.spec.max_episode_steps == steps
    again = gym.make(env.spec)
    assert again.spec.max_episode_steps == steps
    timed = TimeAwareObservation(env, flatten=False)
    assert timed.observation_space["time"].high == steps
    for one in (timed, again):
        one.reset(seed=0, options={"field": OPEN})
        ends = [one.step(LEFT)[2:4] for _ in range(steps)]
        assert ends == [(False, False)] * (steps - 1) + [(False, True)]
        assert one.unwrapped.state.segments == steps


@pytest.mark.parametrize(
    ("arguments", "steps"),
    [
        ({"max_episode_steps": 6}, 6),
        ({"max_episode_steps": 50}, 40),
        ({"max_episode_steps": -1}, 40),
        ({"max_episode_steps": 6, "segments": 5}, 5),
        ({"max_episode_steps": 5, "segments": 6}, 5),
    ],
)
def test_a_limit_of_steps_lowers_the_number_of_segments(arguments: dict, steps: int) -> None:
    envs = gym.make_vec(ENVIRONMENT_ID, num_envs=2, **arguments)
    assert envs.unwrapped.settings.max_segments == envs.spec.max_episode_steps == steps
    again = gym.make_vec(envs.spec)
    assert again.unwrapped.settings.max_segments == steps
    for wrong in (0, 2.5, True, "9"):
        with pytest.raises(ValueError, match="max_episode_steps must be an integer >= 1"):
            gym.make_vec(ENVIRONMENT_ID, num_envs=2, max_episode_steps=wrong)


def test_truncation_is_counted_once() -> None:
    envs = gym.make_vec(ENVIRONMENT_ID, num_envs=4, autoreset_mode="SameStep", segments=3)
    sync = gym.make_vec(
        ENVIRONMENT_ID,
        num_envs=4,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": SAME_STEP},
        segments=3,
    )
    counts = []
    for one in (envs, sync):
        stream, cut, out = np.random.default_rng(0), 0, 0
        one.reset(seed=1)
        for _ in range(80):
            actions = stream.uniform(-0.1, 0.1, (4, 4)).astype(np.float32)
            *_, terminated, truncated, infos = one.step(actions)
            assert not (terminated & truncated).any()
            cut += truncated.sum()
            if (terminated | truncated).any():
                out += (infos["final_info"]["outcome"] == Outcome.OUT_OF_SEGMENTS.code).sum()
        assert cut == out > 20
        counts.append(cut)
    assert counts[0] == counts[1]


def test_autoreset_is_by_the_next_step_unless_said_otherwise() -> None:
    assert VectorObstacleField.metadata["autoreset_mode"] is NEXT_STEP
    for mode in AutoresetMode:
        for given in (mode, mode.value):
            envs = VectorObstacleField(2, autoreset_mode=given)
            assert envs.metadata["autoreset_mode"] is envs.autoreset_mode is mode
    assert gym.make_vec(ENVIRONMENT_ID, num_envs=2).metadata["autoreset_mode"] is NEXT_STEP
    # the class's own is left alone
    assert VectorObstacleField.metadata["autoreset_mode"] is NEXT_STEP


@pytest.mark.parametrize("arguments", OBSERVATIONS)
@pytest.mark.parametrize("flat", [False, True])
def test_checkers_pass(arguments: dict, flat: bool) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gym.make(ENVIRONMENT_ID, **arguments)
        if not flat:
            check_env(env.unwrapped, skip_render_check=True)
        checker.check_env(FlattenObservation(env) if flat else env)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_episode_statistics_add_up(mode: AutoresetMode) -> None:
    envs = wrappers.RecordEpisodeStatistics(VectorObstacleField(3, mode, segments=4))
    envs.reset(seed=0)
    total, length, ends = np.zeros(3), np.zeros(3), 0
    stream, over = np.random.default_rng(0), np.zeros(3, bool)
    for _ in range(60):
        actions = stream.uniform(-0.1, 0.1, (3, 4)).astype(np.float32)
        _, reward, terminated, truncated, infos = envs.step(actions)
        begun = over & (mode is NEXT_STEP)
        assert not reward[begun].any()
        total, length = np.where(begun, 0.0, total + reward), np.where(begun, 0, length + 1)
        over = terminated | truncated
        if over.any():
            np.testing.assert_allclose(infos["episode"]["r"][over], total[over], atol=1e-12)
            np.testing.assert_array_equal(infos["episode"]["l"][over], length[over])
            ends += over.sum()
            if mode is DISABLED:
                envs.reset(options={"reset_mask": over})
            if mode is not NEXT_STEP:
                total[over], length[over] = 0.0, 0
    assert ends > 15


def test_observations_can_be_flattened_as_a_whole() -> None:
    envs = wrappers.FlattenObservation(
        gym.make_vec(ENVIRONMENT_ID, num_envs=3, observation="both", nearest=5)
    )
    scalar = FlattenObservation(gym.make(ENVIRONMENT_ID, observation="both", nearest=5))
    flat, _ = envs.reset(seed=6)
    assert envs.single_observation_space == scalar.observation_space
    for i in range(3):
        expected, _ = scalar.reset(seed=6 + i)
        np.testing.assert_array_equal(flat[i], expected)
    action = np.full((3, 4), 0.01, np.float32)
    np.testing.assert_array_equal(envs.step(action)[0][2], scalar.step(action[2])[0])


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("arguments", [*OBSERVATIONS, {"observation": "both"}])
def test_flat_observations_are_what_gymnasium_flattens(
    arguments: dict, mode: AutoresetMode
) -> None:
    flat = gym.make_vec(
        ENVIRONMENT_ID, num_envs=3, autoreset_mode=mode, flat=True, segments=3, **arguments
    )
    dicts = VectorObstacleField(3, mode, segments=3, **arguments)
    scalar = gym.make(ENVIRONMENT_ID, flat=True, **arguments)
    space = dicts.single_observation_space
    assert flat.single_observation_space == gym.spaces.flatten_space(space)
    assert scalar.observation_space == flat.single_observation_space
    assert flat.observation_space == batch_space(flat.single_observation_space, 3)

    def assert_flattened(one: np.ndarray, other: dict) -> None:
        assert one.dtype == np.float32
        for i in range(3):
            row = {key: value[i] for key, value in other.items()}
            np.testing.assert_array_equal(one[i], gym.spaces.flatten(space, row))

    assert_flattened(flat.reset(seed=6)[0], dicts.reset(seed=6)[0])
    np.testing.assert_array_equal(scalar.reset(seed=6)[0], flat.reset(seed=6)[0][0])
    dicts.reset(seed=6)
    stream = np.random.default_rng(0)
    for _ in range(20):
        actions = stream.uniform(-0.1, 0.1, (3, 4)).astype(np.float32)
        (one, *_, infos), (other, _, terminated, truncated, others) = (
            envs.step(actions) for envs in (flat, dicts)
        )
        assert flat.observation_space.contains(one)
        assert_flattened(one, other)
        for i in np.flatnonzero(others.get("_final_obs", np.zeros(3, bool))):
            last = gym.spaces.flatten(space, others["final_obs"][i])
            np.testing.assert_array_equal(infos["final_obs"][i], last)
        if mode is DISABLED and (over := terminated | truncated).any():
            for envs in (flat, dicts):
                envs.reset(seed=9, options={"reset_mask": over.copy()})
    with pytest.raises(ValueError, match="flat is True or False, got 1"):
        gym.make(ENVIRONMENT_ID, flat=1)


def test_pictures_show_each_flight() -> None:
    envs = VectorObstacleField(2, render_mode="rgb_array")
    with pytest.raises(RuntimeError, match="call reset"):
        envs.render()
    envs.reset(seed=0)
    envs.step(np.array([np.zeros(4), BACK], np.float32))
    images = envs.render()
    assert images is not None
    scalar = ObstacleField(render_mode="rgb_array")
    scalar.reset(seed=0)
    scalar.step(np.zeros(4, np.float32))
    np.testing.assert_array_equal(images[0], scalar.render())
    assert images[1].shape == (800, 800, 3)
    assert (images[0] != images[1]).any()
    envs.close()
    envs.close()
    assert envs.closed
