"""Copies of environments: they cost what their flights cost, and go on exactly as the original."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation import drawn_fields
from ferguson_gym.simulation.batch_simulator import BLOCK, FIRST_BLOCK
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_pool import MAX_FIELDS
from ferguson_gym.world.obstacles import Obstacles

COPIES: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}
OWN = Field(name="own", obstacles=Obstacles.discs([[60.0, 40.0]], [5.0]), goal=[13.0, 13.0])


def actions(stream: np.random.Generator, *shape: int) -> np.ndarray:
    spread = stream.choice([0.02, 0.1, 1.0], (*shape, 1), p=[0.6, 0.3, 0.1])
    return (stream.uniform(-1.0, 1.0, (*shape, 4)) * spread).astype(np.float32)


def flat(value: Any) -> list:
    """Numbers of something returned."""
    if isinstance(value, dict):
        return [number for key in sorted(value) for number in flat(value[key])]
    if isinstance(value, (tuple, list)) or (
        isinstance(value, np.ndarray) and value.dtype == object
    ):
        return [number for one in value for number in flat(one)]
    return [] if value is None else np.ravel(value).tolist()


def assert_same_scalar(one: ObstacleField, other: ObstacleField) -> None:
    assert one.field.name == other.field.name
    assert (one.field.obstacles.centers == other.field.obstacles.centers).all()
    assert one.state.segments == other.state.segments
    assert (one.state.position == other.state.position).all()
    assert (one.control == other.control).all()
    assert (one.refused is None) == (other.refused is None)


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize(
    "arguments",
    [
        {"observation": "both", "flat": True},
        {"fields": "sparse/test:0-30", "rays": 4, "way": 3, "progress": "way", "reference": True},
    ],
)
def test_a_copy_of_a_scalar_environment_goes_on_as_the_original(way: str, arguments: dict) -> None:
    env = gym.make(ENVIRONMENT_ID, segments=6, **arguments)
    env.reset(seed=3)
    stream = np.random.default_rng(0)
    envs, over, names = [env], False, set()
    for k in range(3 * FIRST_BLOCK):
        if k in (2, 9, 70):  # copies of copies, at different places of the queue
            envs.append(COPIES[way](envs[-1]))
        if over:
            results = [flat(one.reset()) for one in envs]
            over = False
        else:
            action = actions(stream)
            steps = [one.step(action) for one in envs]
            over, results = steps[0][2] or steps[0][3], [flat(step) for step in steps]
        assert all(result == results[0] for result in results)
        for other in envs[1:]:
            assert_same_scalar(env.unwrapped, other.unwrapped)
        names.add(env.unwrapped.field.name)
    assert len(envs) == 4
    assert len(names) > 15
    # and each on its own from here on
    envs[1].reset(seed=9)
    assert envs[0].unwrapped.field.name != envs[1].unwrapped.field.name


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("mode", AutoresetMode)
def test_a_copy_of_vector_environments_goes_on_as_the_original(
    mode: AutoresetMode, way: str
) -> None:
    number, stream = 5, np.random.default_rng(1)
    first = VectorObstacleField(number, mode, segments=4, fields=500, capacity=50, suite="sparse")
    envs = [first, COPIES[way](first)]  # also before the first reset
    streams = tuple(np.random.default_rng(i) for i in range(number))
    for one in envs:
        one._streams, one._seeds = list(copy.deepcopy(streams)), list(range(number))
    names = set()
    for one in envs:
        one.reset(options={"field": [OWN, None, "paper:2", None, None]})
    for k in range(2 * BLOCK if mode is AutoresetMode.SAME_STEP else 90):
        if k in (1, 40, 300):
            envs.append(COPIES[way](envs[-1]))
        given = actions(stream, number)
        results = [one.step(given.copy()) for one in envs]
        over = results[0][2] | results[0][3]
        if mode is AutoresetMode.DISABLED and over.any():
            results += [one.reset(options={"reset_mask": over.copy()}) for one in envs]
            results = results[len(envs) :]
        expected = flat(results[0])
        assert all(flat(result) == expected for result in results[1:])
        for i in range(number):
            assert all((one.control(i) == first.control(i)).all() for one in envs)
        if k < 60 or k % 16 == 0 or k == 300:  # `field` draws the discs again
            flown = [[one.field(i).name for i in range(number)] for one in envs]
            assert all(each == flown[0] for each in flown)
            names.update(flown[0])
    assert len(envs) >= 4
    assert len(names) > 30
    states = [[each.bit_generator.state for each in one.np_random] for one in envs]
    assert all(state == states[0] for state in states)


@pytest.mark.parametrize("arguments", [{}, {"suite": "forest"}])
def test_a_copy_costs_what_its_flight_costs(arguments: dict) -> None:
    def cost(env: Any) -> int:
        return len(pickle.dumps(env))

    env = gym.make(ENVIRONMENT_ID, fields=MAX_FIELDS, **arguments)
    envs = gym.make_vec(ENVIRONMENT_ID, num_envs=8, fields=MAX_FIELDS, **arguments)
    before, one = cost(env), cost(gym.make(ENVIRONMENT_ID, fields=1, **arguments))
    assert before < one + 1000
    for _ in range(FIRST_BLOCK + 2):
        env.reset()
        envs.reset()
        envs.step(np.zeros((8, 4), np.float32))
    assert cost(env) < 20_000  # bytes
    assert cost(envs) < 8 * 20_000
    again = copy.deepcopy(env).unwrapped
    assert again._simulator._store.used == 1
    assert again.field.name == env.unwrapped.field.name


def test_a_copy_makes_only_the_fields_that_it_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    env = ObstacleField(fields=MAX_FIELDS)
    env.reset(seed=0)
    env.reset()
    made, usual = [], drawn_fields._put
    monkeypatch.setattr(
        drawn_fields, "_put", lambda *given: (made.extend(given[-1].tolist()), usual(*given))
    )
    again = copy.deepcopy(env)
    assert len(made) == 1  # the field of the flight
    again.step(np.zeros(4, np.float32))
    assert len(made) == 1
    again.reset()
    assert len(made) < FIRST_BLOCK / 4
    env.reset()
    assert env.field.name == again.field.name
