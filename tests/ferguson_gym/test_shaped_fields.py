"""Both environments in fields of obstacles of every shape, alone and mixed with fields of discs."""

import copy
import pickle
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import ferguson_gym
from ferguson_gym.environment import ObstacleField
from ferguson_gym.guidance.way import Way
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import advance, initial_state


def shaped(seed: int, number: int = 12) -> Field:
    """Polygons of 3 to 9 corners, sharp and rounded, boxes, walls and discs."""
    stream = np.random.default_rng(seed)

    def places(count: int) -> np.ndarray:
        return stream.uniform(10.0, 90.0, (count, 2))

    polygons = [
        middle + stream.uniform(1.0, 5.0) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        for middle in places(number)
        if len(angles := np.sort(stream.uniform(0.0, 6.2, stream.integers(3, 10))))
    ]
    low, ends = places(number), places(4)[:, None] + stream.normal(size=(4, 2, 2)) * 4.0
    every = Obstacles.joined(
        [
            Obstacles.polygons(polygons, stream.choice([0.0, 0.7], number)),
            Obstacles.boxes(low, low + stream.uniform(0.5, 6.0, (number, 2))),
            Obstacles.capsules(ends, stream.uniform(0.1, 1.0, 4)),
            Obstacles.discs(places(3), [1.0, 2.0, 3.0]),
        ]
    )
    corners = np.array([[0.0, 0.0], [100.0, 100.0]])
    return Field(
        name=f"shapes {seed}",
        obstacles=every.only((every.signed_distance(corners) > 1.0).all(axis=0)),
    )


def actions(stream: np.random.Generator, *shape: int) -> np.ndarray:
    return stream.uniform(-0.25, 0.25, (*shape, 4)).astype(np.float32)


def same(one: Any, other: Any) -> None:
    for key in one:
        np.testing.assert_array_equal(one[key], other[key])


BOTH: dict[str, Any] = {"observation": "both", "rays": 16, "nearest": 5}


def test_the_step_decides_as_the_plain_one_does() -> None:
    env, stream = ObstacleField(**BOTH), np.random.default_rng(0)
    outcomes = set()
    for seed in range(60):
        field = shaped(seed % 20)
        shown, _ = env.reset(options={"field": field})
        vehicle, clearance = initial_state(field), None
        for _ in range(12):
            same(shown, observe_one(field, vehicle, env.settings))
            action = actions(stream)
            shown, _, terminated, truncated, info = env.step(action)
            step = advance(field, vehicle, action)
            assert env.unwrapped._simulator.outcome[0] == step.outcome.code
            outcomes.add(step.outcome)
            if not step.flown:
                break
            vehicle = step.state
            clear = float(field.obstacles.clearance(env.control).min())
            assert info["clearance"] <= clear + 1e-6
            clearance = info["clearance"]
            assert env.observation_space.contains(shown)
            if terminated or truncated:
                break
        assert clearance is None or clearance > -1e-5
    assert ferguson_gym.Outcome.COLLISION in outcomes


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_many_at_once_are_each_as_one_alone_in_a_pool_of_shapes_and_discs(
    mode: AutoresetMode,
) -> None:
    # corners by the hundred come behind fields of few, those of suites only when they are drawn
    suites = ["forest/train:0-4", "town/train:0-4", "walls/train:0-4"]
    pool = [*(shaped(seed, 3 + seed) for seed in range(5)), *suites]
    number = 70  # threads share the work
    envs = VectorObstacleField(number, mode, fields=pool, segments=6, **BOTH)
    alone = [ObstacleField(fields=pool, segments=6, **BOTH) for _ in range(number)]
    stream = np.random.default_rng(1)
    shown, _ = envs.reset(seed=0)
    each = [env.reset(seed=i)[0] for i, env in enumerate(alone)]
    over = np.zeros(number, np.bool_)
    names = set()
    for step in range(25):
        for i in range(number):
            same({key: value[i] for key, value in shown.items()}, each[i])
        if step % 8 == 0:  # fields are drawn again to be shown
            names |= {envs.field(i).name for i in range(number)}
        flown = actions(stream, number)
        if mode is AutoresetMode.DISABLED and over.any():
            shown, _ = envs.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                each[i], _ = alone[i].reset()
            over[:] = False
            continue
        shown, rewards, terminated, truncated, infos = envs.step(flown)
        for i, env in enumerate(alone):
            if mode is AutoresetMode.NEXT_STEP and over[i]:
                each[i], _ = env.reset()
                continue
            each[i], reward, *_, info = env.step(flown[i])
            assert reward == rewards[i]
            if mode is AutoresetMode.SAME_STEP and (terminated | truncated)[i]:
                same(infos["final_obs"][i], each[i])
                assert infos["final_info"]["clearance"][i] == info["clearance"]
                each[i], _ = env.reset()
        over = terminated | truncated
    assert len(names) > 12


def test_corners_find_room_at_resets_and_after_changes_of_fields() -> None:
    envs = gym.make_vec("ferguson/ObstacleField-v0", num_envs=80, capacity=100, fields=9, **BOTH)
    stream = np.random.default_rng(2)
    envs.reset(seed=0)
    fields: list[Field | None] = [None] * 80
    for k, number in enumerate([1, 4, 20]):
        envs.step(actions(stream, 80))
        fields[10 * k + 3] = shaped(k, number)
        shown, _ = envs.reset(options={"field": fields})
        i = 10 * k + 3
        for _ in range(3):
            alone = observe_one(envs.field(i), envs.state(i), Settings(**BOTH))
            same({key: value[i] for key, value in shown.items()}, alone)
            shown, *_ = envs.step(actions(stream, 80) * np.float32(0.1))
    envs.set_arguments(fields=[shaped(5, 25), "sparse/train:1"], indices=[1, 2, 79])
    envs.set_arguments(suite="town", indices=[3, 4])
    for _ in range(60):
        envs.step(actions(stream, 80))
    assert {envs.field(i).name for i in (1, 2, 79)} <= {"shapes 5", "sparse/train:1"}
    assert envs.field(3).name.startswith("town/train:")
    with pytest.raises(ValueError, match="obstacles, the environment holds at most 100"):
        envs.reset(options={"field": shaped(6, 60)})


@pytest.mark.parametrize("how", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("number", [1, 80])
def test_copies_fly_on_as_the_original(how: Any, number: int) -> None:
    pool = [shaped(1, 2), shaped(2, 15), "standard/train:0-5"]
    envs = VectorObstacleField(number, fields=pool, capacity=70, way=0, **BOTH)
    stream = np.random.default_rng(3)
    envs.reset(seed=4, options={"field": [shaped(7, 20)] + [None] * (number - 1)})
    envs.step(actions(stream, number))
    twin = how(envs)
    for _ in range(40):
        flown = actions(stream, number)
        one, other = envs.step(flown), twin.step(flown)
        same(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_checkers_of_gymnasium_and_stable_baselines_accept_such_fields() -> None:
    from stable_baselines3.common.env_checker import check_env as check_for_sb3

    for kind in ("rays", "both"):
        arguments: dict[str, Any] = {"fields": [shaped(8), shaped(9, 30)], "observation": kind}
        env = gym.make("ferguson/ObstacleField-v0", render_mode="rgb_array", **arguments)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", message=".*different kinds of render modes.*")
            check_env(env.unwrapped)
        check_for_sb3(gym.make("ferguson/ObstacleField-v0", flat=True, **arguments).unwrapped)


@pytest.mark.parametrize("mode", ["rgb_array", "rgb_array_list"])
def test_flights_among_shapes_are_rendered(mode: str) -> None:
    env = ObstacleField(render_mode=mode)
    env.reset(options={"field": shaped(10)})
    env.step(np.zeros(4, np.float32))
    drawn = env.render()
    images = drawn if mode == "rgb_array_list" else [drawn]
    assert images[-1].shape == (800, 800, 3)
    assert images[-1].std() > 1.0
    env.close()
    envs = VectorObstacleField(2, render_mode="rgb_array", capacity=60)
    envs.reset(options={"field": shaped(10)})
    rendered = envs.render()
    assert rendered is not None
    np.testing.assert_array_equal(rendered[0], rendered[1])


@pytest.mark.parametrize("progress", ["straight", "way"])
def test_the_way_is_shown_and_measures_progress_among_shapes(progress: str) -> None:
    fields = [shaped(13, 8), get_field("town/train:1"), get_field("walls/train:1")]
    arguments: dict[str, Any] = {"way": 6, "margin": 0.5, "progress": progress, "reference": True}
    envs = VectorObstacleField(3, "Disabled", capacity=100, **BOTH, **arguments)
    shown, infos = envs.reset(options={"field": fields})
    for i, field in enumerate(fields):
        assert infos["shortest"][i] == exact_length(field)
        alone, way = ObstacleField(**BOTH, **arguments), Way(field, 0.5)
        one, _ = alone.reset(options={"field": field})
        same({key: value[i] for key, value in shown.items()}, one)
        whole = float(way.ahead([field.start], [[30.0]])[1][0])
        exact = exact_length(field)
        assert exact is not None
        assert exact < whole < 1.2 * exact
        stream = np.random.default_rng(i)
        for _ in range(60):
            action, before = actions(stream), alone.state
            one, reward, *_, info = alone.step(action)
            if alone.state.segments == before.segments:
                alone.reset(options={"field": field})
                continue
            state = alone.state
            places, left = way.ahead([state.position], [np.arange(1, 7) * 5.0])
            forward = state.derivative / np.hypot(*state.derivative)
            axes = np.array([forward, [-forward[1], forward[0]]])
            ahead = (places[0] - state.position) @ axes.T / 30.0
            np.testing.assert_allclose(one["way"][:12].reshape(6, 2), ahead, rtol=0, atol=1e-6)
            if progress == "way" and info["segments"] == 1:
                gained = whole - left[0]
                detour = info["path_length"] - gained
                expected = (gained - 4.0 * detour) / whole
                assert reward == pytest.approx(expected if info["outcome"] == 0 else expected - 2.0)


def test_simulated_rollouts_are_what_the_environment_does() -> None:
    fields = [shaped(11, 2), shaped(12, 20)]
    settings = Settings(**BOTH)
    stream = np.random.default_rng(5)
    which = np.arange(10) % 2
    flights = SimulatedRollouts(fields, which, [initial_state(fields[i]) for i in which], settings)
    envs = [ObstacleField(**BOTH) for _ in which]
    shown = [env.reset(options={"field": fields[i]})[0] for env, i in zip(envs, which, strict=True)]
    while len(flights.active):
        for place, i in enumerate(flights.active):
            same({key: value[place] for key, value in flights.observations.items()}, shown[i])
        flown = actions(stream, len(flights.active)) * np.float32(0.5)
        for place, i in enumerate(flights.active):
            shown[i] = envs[i].step(flown[place])[0]
        flights.step(flown)
        outcomes = flights.buffers.flights["outcome"]
        expected = [envs[i].unwrapped._simulator.outcome[0] for i in flights.active]
        np.testing.assert_array_equal(outcomes, expected)
        flights.keep(flights.flying)
