"""Arguments that change between flights, from the next reset on, in every kind of environment."""

import copy
import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation import batch_simulator
from ferguson_gym.simulation.settings import ARGUMENTS, CHANGEABLE
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

BACK = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
AHEAD = np.zeros(4, np.float32)
OPEN = Field(name="open", obstacles=Obstacles.discs([], []), goal=[6.0, 6.0])


def actions(stream: np.random.Generator, number: int) -> np.ndarray:
    spread = stream.choice([0.0, 0.05, 0.3], (number, 1))
    return (stream.uniform(-1.0, 1.0, (number, 4)) * spread).astype(np.float32)


def test_every_argument_can_be_read_as_an_attribute() -> None:
    env = ObstacleField(obstacles=9, radii=[2.0, 3.0], gate=1.5)
    for name in ARGUMENTS:
        assert getattr(env, name) == getattr(env.settings, name)
    assert (env.obstacles, env.radii, env.gate) == (9, (2.0, 3.0), 1.5)


def test_a_change_takes_effect_at_the_next_reset() -> None:
    env = gym.make(ENVIRONMENT_ID, failure=2.0, obstacles=10)
    env.reset(seed=4)
    env.set_wrapper_attr("obstacles", 30)
    env.get_wrapper_attr("set_arguments")(failure=7.0, radii=(1.0, 2.0), segments=50)
    assert env.unwrapped.obstacles == 30
    assert env.unwrapped.field.name == "standard/train:4, 10 obstacles"
    assert env.step(BACK)[1] == -2.0  # the flight under way keeps its price
    env.reset()
    assert re.fullmatch(
        r"standard/train:\d+, 30 obstacles, radii 1 to 2 m", env.unwrapped.field.name
    )
    assert env.step(BACK)[1] == -7.0
    assert env.unwrapped.spec.max_episode_steps == 50
    env.reset(options={"obstacles": 0, "radii": None, "failure": 1.0})
    assert len(env.unwrapped.field.obstacles) == 0
    assert env.step(BACK)[1] == -1.0
    env.reset()  # and is kept
    assert len(env.unwrapped.field.obstacles) == 0


def test_gate_and_segments_of_a_flight_are_those_of_its_reset() -> None:
    env = ObstacleField(gate=0.0, segments=3)
    for gate in (0.0, 2.5):
        env.reset(options={"field": OPEN, "gate": gate})
        env.gate = 2.5 - gate
        _, _, terminated, _, info = env.step(np.array([-0.05, 0.0, 0.0, 0.0], np.float32))
        assert info["is_success"] == terminated == (gate > 0.0)
    env.segments = 60
    wide = Field(name="wide", obstacles=Obstacles.discs([], []), start=[50.0, 50.0])
    env.reset(options={"field": wide})
    left = np.array([-0.3, 0.3, 0.0, 0.0], np.float32)
    for k in range(1, 6):
        seen, *_ = env.step(left)
        assert seen["vehicle"][5] == np.float32(1.0 - k / 60)
    assert env.control.shape == (5, 4, 2)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_native_environments_change_as_scalar_ones_do(mode: AutoresetMode) -> None:
    number, stream = 4, np.random.default_rng(0)
    made: dict[str, Any] = {"fields": 300, "segments": 4, "obstacles": 12, "capacity": 90}
    mine = VectorObstacleField(number, mode, **made)
    theirs = SyncVectorEnv([lambda: ObstacleField(**made)] * number, autoreset_mode=mode)
    for envs in (mine, theirs):
        envs.reset(seed=2)
    changes: list[tuple[str, Any]] = [
        ("obstacles", [5, 40, 5, 60]),
        ("failure", 5.0),
        ("radii", [(1.0, 2.0)] * number),
        ("gate", [0.0, 1.0, 2.0, 2.9]),
        ("segments", 7),
        ("split", "validation"),
        ("obstacles", None),
        ("fields", 20),
        ("detour", [0.0, 1.0, 2.0, 3.0]),
        ("fields", 300),
        ("segments", 3),
    ]
    names = set()
    for k in range(160):
        if k % 8 == 5 and changes:
            name, value = changes.pop(0)
            for envs in (mine, theirs):
                envs.set_attr(name, value)
            assert mine.get_attr(name) == theirs.get_attr(name)
        given = actions(stream, number)
        results = [envs.step(given) for envs in (mine, theirs)]
        over = results[0][2] | results[0][3]
        if mode is AutoresetMode.DISABLED and over.any():
            options = {"detour": 0.5} if k > 120 else {}
            results += [
                envs.reset(options={"reset_mask": over.copy(), **options})
                for envs in (mine, theirs)
            ]
        for one, other in zip(results[::2], results[1::2], strict=True):
            for key, value in other[0].items():
                np.testing.assert_array_equal(one[0][key], value)
            for mine_too, value in zip(one[1:-1], other[1:-1], strict=True):
                np.testing.assert_array_equal(mine_too, value)
            assert set(one[-1]) == set(other[-1])
            np.testing.assert_array_equal(one[-1]["clearance"], other[-1]["clearance"])
        assert [field.name for field in mine.get_attr("field")] == [
            env.field.name for env in theirs.envs
        ]
        names |= {field.name.partition(", ")[2] for field in mine.call("field")}
    assert {
        "5 obstacles",
        "60 obstacles",
        "40 obstacles, radii 1 to 2 m",
        "radii 1 to 2 m",
    } <= names
    assert mine.get_attr("settings") == tuple(env.settings for env in theirs.envs)


def test_changes_in_every_episode_keep_few_fields_and_the_seeds_that_were_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    env, twin = ObstacleField(), ObstacleField()
    for one in (env, twin):
        one.reset(seed=1)
    for k in range(200):
        env.reset(options={"obstacles": 10 + k % 50})
        twin.reset()
        assert env.field.name == f"{twin.field.name}, {10 + k % 50} obstacles"
        assert len(env.field.obstacles) == 10 + k % 50
        if k == 100:
            env = copy.deepcopy(env)
    assert env._simulator._store.used < 200
    assert env._simulator._drawn.sources <= batch_simulator.SOURCES + 2


def test_a_pair_of_radii_is_one_value() -> None:
    envs = VectorObstacleField(2)
    envs.set_attr("radii", (2.0, 3.0))
    assert envs.get_attr("radii") == ((2.0, 3.0),) * 2
    envs.set_attr("radii", [(2.0, 3.0), None])
    assert envs.get_attr("radii") == ((2.0, 3.0), None)
    envs.set_arguments([1], radii=(1.0, 1.5), obstacles=8)
    assert envs.get_attr("obstacles") == (None, 8)
    assert envs.call("set_arguments", obstacles=9) == (None, None)
    assert envs.call("obstacles") == (9, 9)


@pytest.mark.parametrize("name", [name for name in ARGUMENTS if name not in CHANGEABLE])
def test_arguments_that_shape_observations_are_fixed(name: str) -> None:
    env, envs = ObstacleField(), VectorObstacleField(2)
    value = getattr(env, name)
    with pytest.raises(AttributeError, match=f"{name} cannot be set; make a new ObstacleField"):
        setattr(env, name, value)
    with pytest.raises(AttributeError, match=f"{name} cannot be set; make a new VectorObstacleF"):
        envs.set_attr(name, value)
    for change in (env.set_arguments, envs.set_arguments):
        with pytest.raises(ValueError, match=f"{name} does not change between flights; suite, "):
            change(**{name: value})


def test_bad_changes_are_refused_and_nothing_has_changed() -> None:
    env, envs = ObstacleField(), VectorObstacleField(3)
    for one in (env, envs):
        one.reset(seed=0)
        before = one.settings
        for options, message in (
            ({"obstacles": -1}, "0 to 10000 obstacles, got obstacles=-1"),
            ({"failure": 200, "gate": 2.0}, "penalty failure lies between 0 and 100, got 200"),
            ({"suite": "traps", "obstacles": 9}, "obstacles of suite 'traps' are fixed"),
            ({"obstacle": 9}, r"unknown reset options \['obstacle'\]; known: .*'obstacles'"),
            ({"gate": 2.0, "field": "paper:9"}, "the paper has fields 1 to 4, not 9"),
        ):
            with pytest.raises(ValueError, match=message):
                one.reset(options=options)
            assert one.settings is before
    with pytest.raises(ValueError, match="need one obstacles or 3, got 2"):
        envs.set_attr("obstacles", [1, 2])
    with pytest.raises(ValueError, match="got obstacles=-1"):
        envs.set_attr("obstacles", [1, 2, -1])
    assert envs.get_attr("obstacles") == (None,) * 3
