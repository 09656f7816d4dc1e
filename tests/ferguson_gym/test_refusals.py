"""What the environments refuse: one clear error, and nothing has changed afterwards."""

import copy
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation.settings import INFOS
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.suites import suite_field

BACK = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
"""A segment that is refused."""
SOME = np.array([True, False, False])
WIDE = Field(name="wide", obstacles=Obstacles.discs(np.full((51, 2), 60.0), np.ones(51)))
SPACE = Field(
    name="space",
    obstacles=Obstacles.discs(np.empty((0, 3)), []),
    start=np.zeros(3),
    goal=np.ones(3) * 9,
)
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
FLAT = suite_field("sparse", "train", 0)


BAD_RESETS: list[tuple[dict, str]] = [
    ({"seed": -1}, "a seed is an integer from 0 to .* got -1"),
    ({"seed": 1.0}, r"integer .* got 1\.0"),
    ({"seed": True}, "integer .* got True"),
    ({"seed": "7"}, "integer .* got '7'"),
    ({"seed": 2**63 - 2}, f"integer .* got {2**63}"),
    ({"seed": [[1.0], [1.0, 2.0], []]}, r"integer .* got \[1\.0\]"),
    ({"seed": np.array(7.0)}, r"integer .* got 7\.0"),
    ({"seed": [1, 2]}, "need one seed or 3, got 2"),
    ({"seed": [1, 2, -3]}, "integer .* got -3"),
    ({"seed": [1, False, 3]}, "integer .* got False"),
    ({"seed": [1, None, 3.0]}, r"integer .* got 3\.0"),
    ({"seed": 5, "options": "wind"}, "reset options are a dictionary with 'field'.* got 'wind'"),
    ({"seed": 5, "options": 3}, "reset options are a dictionary with 'field'.* got 3"),
    ({"seed": 5, "options": {"wind": 1, 3: 1}}, r"unknown reset options \[3, 'wind'\]"),
    ({"seed": 5, "options": {"wind": 1}}, r"unknown reset options \['wind'\]; .* 'field'"),
    ({"seed": 5, "options": {"field": 7}}, "must be a Field or the name of one, got int"),
    ({"seed": 5, "options": {"field": "paper:5"}}, "the paper has fields 1 to 4, not 5"),
    ({"seed": 5, "options": {"field": [FLAT]}}, "must be one field or 3, got 1"),
    ({"seed": 5, "options": {"field": [FLAT, None, 7]}}, "must be a Field .* got int"),
    ({"seed": 5, "options": {"field": WIDE}}, "field wide has 51 obstacles, .* capacity=51"),
    ({"seed": 5, "options": {"field": [FLAT, None, SPACE]}}, "planar, field space has 3 dim"),
    ({"seed": 5, "options": {"field": [FLAT, None, SPACE]}}, "planar, field space has 3 dim"),
    ({"seed": 5, "options": {"reset_mask": [True] * 3}}, "must be a NumPy array of bool"),
    ({"seed": 5, "options": {"reset_mask": np.ones(3)}}, "must be a NumPy array of bool"),
    ({"seed": 5, "options": {"reset_mask": SOME[:2]}}, r"must have shape \(3,\), got \(2,\)"),
    ({"seed": 5, "options": {"reset_mask": np.zeros(3, bool)}}, "chooses no environment"),
    ({"seed": [5, 6], "options": {"reset_mask": SOME}}, "need one seed or 3, got 2"),
]


def actions_with(index: tuple[int, int], value: float) -> np.ndarray:
    actions = np.zeros((3, 4))
    actions[index] = value
    return actions


BAD_ACTIONS: list[tuple[Any, str]] = [
    (np.zeros(4, np.float32), r"action must have shape \(3, 4\), got \(4,\)"),
    (np.zeros((2, 4), np.float32), r"must have shape \(3, 4\), got \(2, 4\)"),
    (np.zeros((3, 5)), r"must have shape \(3, 4\), got \(3, 5\)"),
    (None, "action must be an array of numbers"),
    ("fly", "action must be an array of numbers"),
    ([[0.0] * 4, [0.0] * 3, [0.0] * 4], "action must be an array of numbers"),
    (actions_with((1, 2), np.nan), r"action \(environment 1\) must be finite, got nan"),
    (actions_with((0, 0), -np.inf), r"action \(environment 0\) must be finite, got -inf"),
    (actions_with((2, 3), 1e300), r"action \(environment 2\) must be finite, got inf"),
    (
        actions_with((2, 0), 1.5),
        r"an action lies in \[-1, 1\], got \[1.5, 0.0, 0.0, 0.0\] \(environment 2\); clip it",
    ),
    (actions_with((1, 3), -1.001).astype(np.float32), r"got .*-1.00.*\] \(environment 1\)"),
    (actions_with((1, 1), 1.0 + 2e-7).astype(np.float32), r"\(environment 1\)"),
]


MADE: dict[type, dict] = {VectorObstacleField: {"num_envs": 3, "fields": 99}, ObstacleField: {}}


def draws(envs: Any) -> list[dict]:
    """Where the sources of randomness are."""
    sources = envs.np_random if isinstance(envs, VectorObstacleField) else [envs.np_random]
    return [source.bit_generator.state for source in sources]


def is_refused(envs: Any, call: str, given: tuple, message: str) -> None:
    """The call fails, and afterwards all goes on as if it had not been made."""
    twin = type(envs)(**MADE[type(envs)])
    for one in (envs, twin):
        one.reset(seed=1, options={"field": OPEN})
        one.step(np.zeros(one.action_space.shape, np.float32))
    arguments = {} if call == "step" else given[0]
    kept = copy.deepcopy(arguments)
    with pytest.raises((ValueError, TypeError), match=message):
        getattr(envs, call)(*(given if call == "step" else ()), **arguments)
    assert set(arguments) == set(kept)
    if isinstance(kept.get("options"), dict):
        assert set(arguments["options"]) == set(kept["options"])
    assert draws(envs) == draws(twin)
    stream = np.random.default_rng(0)
    for k in range(6):
        actions = stream.uniform(-0.05, 0.05, envs.action_space.shape).astype(np.float32)
        if k % 2:  # which draws the next field
            results = [one.reset() for one in (envs, twin)]
        else:
            results = [one.step(actions) for one in (envs, twin)]
        (seen, *_, infos), (twin_seen, *_, twin_infos) = results
        for key, value in seen.items():
            np.testing.assert_array_equal(value, twin_seen[key])
        for key in INFOS:
            np.testing.assert_array_equal(infos[key], twin_infos[key])


@pytest.mark.parametrize(("arguments", "message"), BAD_RESETS)
def test_a_bad_reset_is_refused_and_nothing_changes(arguments: dict, message: str) -> None:
    is_refused(VectorObstacleField(3, fields=99), "reset", (arguments,), message)


@pytest.mark.parametrize(("actions", "message"), BAD_ACTIONS)
def test_bad_actions_are_refused_and_nothing_changes(actions: Any, message: str) -> None:
    is_refused(VectorObstacleField(3, fields=99), "step", (actions,), message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "integer from 0 to .* got -1"),
        ({"seed": True}, "integer .* got True"),
        ({"seed": 2.0}, r"integer .* got 2\.0"),
        ({"seed": 2**63}, "integer .* got 9223372036854775808"),
        ({"seed": 5, "options": {"wind": 3}}, "unknown reset options"),
        ({"seed": 5, "options": []}, r"reset options are a dictionary with 'field', .* got \[\]"),
        ({"seed": 5, "options": {"field": SPACE}}, "planar, field space has 3 dimensions"),
    ],
)
def test_the_scalar_environment_refuses_alike(arguments: dict, message: str) -> None:
    is_refused(ObstacleField(), "reset", (arguments,), message)


def test_the_scalar_environment_makes_room_for_more_obstacles() -> None:
    env, fresh = ObstacleField(suite="sparse"), ObstacleField(suite="sparse", capacity=200)
    field = suite_field("forest", "train", 3)
    for k, options in enumerate((None, None, {"field": field}, None, {"field": FLAT}, None, None)):
        (seen, info), (expected, expected_info) = (
            one.reset(seed=None if k else 5, options=options) for one in (env, fresh)
        )
        for key, value in seen.items():
            np.testing.assert_array_equal(value, expected[key])
        assert info == expected_info
        assert info["clearance"] == env.field.obstacles.signed_distance(np.zeros(2)).min()
        assert env.step(np.zeros(4))[1:] == fresh.step(np.zeros(4))[1:]


def test_steps_before_a_reset_and_first_resets_of_some_are_refused() -> None:
    envs = VectorObstacleField(3)
    for call in (lambda: envs.step(np.zeros((3, 4))), lambda: envs.field(0), lambda: envs.state(0)):
        with pytest.raises(RuntimeError, match=r"no fields yet: call reset\(\) first"):
            call()
    with pytest.raises(ValueError, match="first reset starts every environment: leave reset_mask"):
        envs.reset(seed=1, options={"reset_mask": SOME})
    with pytest.raises(RuntimeError, match="call reset"):
        envs.step(np.zeros((3, 4)))
    assert len(envs.control(0)) == 0
    assert envs.refused(0) is None
    envs.reset(seed=1, options={"reset_mask": np.ones(3, bool)})
    assert envs.field(2).name == "standard/train:3"


def test_without_autoreset_a_finished_flight_must_be_reset_first() -> None:
    envs = VectorObstacleField(13, autoreset_mode="Disabled")
    envs.reset(options={"field": OPEN})
    actions = np.zeros((13, 4), np.float32)
    actions[1:] = BACK
    *_, terminated, _, _ = envs.step(actions)
    assert terminated[1:].all()
    assert not terminated[0]
    with pytest.raises(RuntimeError, match=r"environments \[1, 2, .* 10\] and others: call reset"):
        envs.step(actions)
    assert envs.state(0).segments == 1
    mask = terminated.copy()
    mask[4] = False
    envs.reset(options={"reset_mask": mask, "field": OPEN})
    with pytest.raises(RuntimeError, match=r"over in environments \[4\]: call reset"):
        envs.step(actions)
    envs.reset(options={"reset_mask": np.arange(13) == 4, "field": OPEN})
    envs.step(np.zeros((13, 4)))
    assert envs.state(0).segments == 2


@pytest.mark.parametrize(
    ("number", "arguments", "message"),
    [
        (0, {}, "num_envs must be an integer >= 1, got 0"),
        (-3, {}, "got -3"),
        (2.0, {}, r"got 2\.0"),
        (True, {}, "got True"),
        (10**400, {}, "at most 10000000 environments are made at once, got 10000000000"),
        ("2", {}, "got '2'"),
        (2, {"autoreset_mode": "Sometimes"}, "'Sometimes'; modes are NextStep, SameStep, Disabled"),
        (2, {"autoreset_mode": np.zeros(3, [("x", float)])}, r"unknown autoreset mode array"),
        (2, {"autoreset_mode": None}, "unknown autoreset mode None"),
        (2, {"render_mode": "human"}, "unknown render mode 'human'; .* rgb_array only"),
        (2, {"observation": "sonar"}, "unknown observation 'sonar'; kinds are discs, rays"),
        (2, {"suite": "jungle"}, "unknown suite 'jungle'; suites are standard"),
        (2, {"split": "exam"}, "unknown split 'exam'; splits are train"),
    ],
)
def test_bad_arguments_are_refused(number: Any, arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        VectorObstacleField(number, **arguments)


@pytest.mark.parametrize(
    ("make", "known"),
    [
        (ObstacleField, "render_mode"),
        (VectorObstacleField, "num_envs, autoreset_mode, render_mode, max_episode_steps"),
        (partial(gym.make, ENVIRONMENT_ID), "render_mode"),
        (partial(gym.make_vec, ENVIRONMENT_ID), "num_envs, autoreset_mode"),
    ],
)
def test_unknown_arguments_are_refused_in_the_words_of_python(
    make: Callable[..., Any], known: str
) -> None:
    # TorchRL probes with `frameskip` and goes on only if these words come back
    message = r"__init__\(\) got an unexpected keyword argument 'frameskip'; known are suite, split"
    with pytest.raises(TypeError, match=rf"{message}, .*{known}"):
        make(frameskip=1, wind=2)
    with pytest.raises(TypeError, match=r"'obstacle' \(did you mean 'obstacles'\?\); known are"):
        make(obstacle=3)
