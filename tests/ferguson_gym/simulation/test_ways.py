"""Ways in environments: what is shown, rewarded and reported, whatever happens between flights."""

from __future__ import annotations

import copy
import gc
import pickle
import weakref
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from ferguson_gym.environment import ObstacleField
from ferguson_gym.guidance import tree_pool
from ferguson_gym.guidance.way import Way, with_margin
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import distance_to_goal
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.simulation import ways
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import initial_state
from planners.registry import make
from tests.support.scaled_fields import Motion

WAY: dict[str, Any] = {"rays": 3, "way": 4, "progress": "way", "reference": True}
ENCLOSED = Field(
    name="enclosed",
    obstacles=Obstacles.discs(
        [[80 + 9 * np.cos(a), 80 + 9 * np.sin(a)] for a in range(7)], [6.0] * 7
    ),
    goal=[80.0, 80.0],
)
"""No path leads to the goal."""


def flight(field: Field) -> list[Array]:
    """Actions of a flight to the goal."""
    plan = make("pursuit").plan(field, initial_state(field), 0)
    assert plan.success
    unit = field.limits.unit
    return [encode(one, one[0], one[2], unit) for one in plan.control]


def drawn(stream: np.random.Generator, number: int) -> Array:
    """Actions (number, 4), most of them small enough that flights go on."""
    spread = stream.choice([0.02, 0.1, 1.0], (number, 1), p=[0.6, 0.3, 0.1])
    return (stream.uniform(-1.0, 1.0, (number, 4)) * spread).astype(np.float32)


def assert_equal(one: Any, other: Any) -> None:
    """Equal in every number."""
    if isinstance(one, dict):
        assert set(one) == set(other)
        for key in one:
            assert_equal(one[key], other[key])
    elif isinstance(one, tuple) or (isinstance(one, np.ndarray) and one.dtype == object):
        for mine, theirs in zip(one, other, strict=True):
            assert_equal(mine, theirs)
    elif one is not None:
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_points_ahead_are_shown_in_the_body_frame(scale: float) -> None:
    field = Motion(scale=scale).field(get_field("dense/train:2"))
    env = ObstacleField(rays=3, way=5, margin=1.1, view=40.0)
    seen, _ = env.reset(options={"field": field})
    view = 40.0 * scale
    way, shown = Way(field, 1.1), 8.0 * np.arange(1, 6)[None]
    for action in flight(field):
        state = env.state
        places, (togo,) = way.ahead(state.position[None], shown)
        ahead = state.derivative / np.linalg.norm(state.derivative)
        left = np.array([-ahead[1], ahead[0]])
        points = seen["way"][:10].reshape(5, 2)
        for spot, point in zip(places[0], points, strict=True):
            away = (spot - state.position) / view
            np.testing.assert_allclose(point, [away @ ahead, away @ left], rtol=0, atol=1e-6)
        assert seen["way"][10] == pytest.approx(min(togo / view, 1.0), abs=1e-6)
        far = togo / (2.0 * np.sqrt(2.0) * 120.0 * scale)
        assert seen["way"][11] == pytest.approx(min(far, 1.0), abs=1e-6)
        seen, *_, info = env.step(action)
    assert info["is_success"]
    assert not seen["way"].any()  # all on the goal, where the vehicle is


@pytest.mark.parametrize("name", ["standard/train:1", "traps/train:0", "forest/train:2"])
def test_rewards_along_the_way_sum_to_one_less_the_detour(name: str) -> None:
    field = get_field(name)
    env = ObstacleField(progress="way", margin=0.8, detour=3.0, rays=3)
    env.reset(options={"field": field})
    steps = [env.step(action) for action in flight(field)]
    info = steps[-1][-1]
    assert info["is_success"]
    whole = with_margin(field, 0.8)([field.start])[0][0]
    assert whole > 1.001 * field.distance
    total = sum(reward for _, reward, *_ in steps)
    assert total == pytest.approx(1.0 - 3.0 * (info["path_length"] / whole - 1.0), abs=1e-9)


def test_a_failed_flight_along_the_way_costs_its_penalty() -> None:
    field = get_field("standard/train:1")
    togo = with_margin(field, 0.8)
    env = ObstacleField(progress="way", detour=2.0, failure=1.5, segments=3, rays=3)
    env.reset(options={"field": field})
    steps = [env.step(action) for action in flight(field)[:3]]
    *_, truncated, info = steps[-1]
    assert truncated
    whole, left = (togo([point])[0][0] for point in (field.start, env.state.position))
    progress = whole - left
    expected = (progress - 2.0 * (info["path_length"] - progress)) / whole - 1.5
    assert sum(reward for _, reward, *_ in steps) == pytest.approx(expected, abs=1e-9)
    # a refused segment makes no progress
    env.reset(options={"field": field})
    _, reward, terminated, *_ = env.step(np.array([1.0, 0.0, 1.0, 1.0], np.float32))
    assert terminated
    assert reward == -1.5


@pytest.mark.parametrize("mode", AutoresetMode)
def test_the_reference_is_the_exact_length_of_the_field_that_is_flown(mode: AutoresetMode) -> None:
    envs = VectorObstacleField(
        4, mode, fields=9, segments=3, reference=True, rays=3, suite="sparse"
    )
    _, infos = envs.reset(seed=0)
    stream, ends = np.random.default_rng(0), 0
    for _ in range(25):
        flown = [exact_length(envs.field(i)) for i in range(4)]
        _, _, terminated, truncated, infos = envs.step(drawn(stream, 4))
        over = terminated | truncated
        ends += over.sum()
        if mode is AutoresetMode.SAME_STEP and over.any():
            final = infos["final_info"]["shortest"]
            np.testing.assert_array_equal(final, np.where(over, flown, 0.0))
        assert infos["shortest"].tolist() == [exact_length(envs.field(i)) for i in range(4)]
        if mode is AutoresetMode.DISABLED and over.any():
            _, infos = envs.reset(options={"reset_mask": over})
            known = [exact_length(envs.field(i)) if over[i] else 0.0 for i in range(4)]
            assert infos["shortest"].tolist() == known
    assert ends > 5


def test_without_a_path_rewards_are_straight_and_the_reference_is_infinite() -> None:
    env, plain = ObstacleField(**WAY), ObstacleField(rays=3)
    seen, info = env.reset(options={"field": ENCLOSED})
    plain.reset(options={"field": ENCLOSED})
    assert info["shortest"] == np.inf
    for turn in (0.0, 0.1, 0.0):
        action = np.array([0.0, turn, 0.0, 0.0], np.float32)
        assert env.observation_space.contains(seen)
        assert seen["way"].tolist() == [0.0] * 8 + [1.0, 1.0]
        seen, reward, *_ = env.step(action)
        assert reward == plain.step(action)[1]


def test_flat_observations_hold_the_way_last() -> None:
    env, flat = (
        ObstacleField(**WAY, suite="sparse", obstacles=3, flat=kind) for kind in (False, True)
    )
    seen, row = env.reset(seed=3)[0], flat.reset(seed=3)[0]
    for _ in range(3):
        np.testing.assert_array_equal(row, spaces.flatten(env.observation_space, seen))
        np.testing.assert_array_equal(row[-10:], seen["way"])
        assert flat.observation_space.contains(row)
        seen, row = (one.step(np.zeros(4, np.float32))[0] for one in (env, flat))


def test_changed_fields_have_other_ways_from_the_next_flight_on() -> None:
    envs = VectorObstacleField(3, AutoresetMode.SAME_STEP, fields=6, suite="sparse", **WAY)
    seen, _ = envs.reset(seed=1)
    before, still = seen["way"].copy(), envs.field(0).name
    envs.set_arguments([0, 1], obstacles=0)
    seen, *_ = envs.step(np.zeros((3, 4), np.float32))
    assert envs.field(0).name == still
    assert (seen["way"] != before).any(axis=1).all()
    seen, infos = envs.reset()
    # in the empty field the way leads straight ahead
    straight = np.column_stack([np.arange(1, 5) / 4.0, np.zeros(4)]).ravel()
    np.testing.assert_allclose(seen["way"][:2, :8], [straight] * 2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(infos["shortest"][:2], np.sqrt(2.0) * 100.0)
    assert infos["shortest"][2] == exact_length(envs.field(2))
    for k in range(12):  # many sources of fields, after which drawn ones are forgotten
        envs.set_arguments(radii=(1.0, 1.5 + 0.1 * k), obstacles=30)
        seen, infos = envs.reset()
        for i in range(3):
            field = envs.field(i)
            alone = ObstacleField(**WAY).reset(options={"field": field})
            np.testing.assert_array_equal(seen["way"][i], alone[0]["way"])
            assert infos["shortest"][i] == exact_length(field)


@pytest.mark.parametrize("few", [200, 0])
def test_forgotten_trees_are_made_again_and_change_nothing(
    few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory for a few trees gives the numbers of memory for all; without trees, too."""
    monkeypatch.setattr(distance_to_goal, "FEW", few)
    monkeypatch.setattr(ways, "_UNUSED", 0)
    number = 4
    arguments = {**WAY, "fields": "sparse/train:0-29", "segments": 3, "reference": few > 0}
    one, other = (VectorObstacleField(number, "SameStep", **arguments) for _ in range(2))
    for envs in (one, other):
        envs.reset(seed=0)
    stream, pool, most = np.random.default_rng(2), other._simulator._ways._pool, 0
    for k in range(40):
        if k % 10 == 9:
            assert_equal(*(envs.reset(seed=k) for envs in (one, other)))
        actions = drawn(stream, number)
        expected = one.step(actions)
        with monkeypatch.context() as patch:
            patch.setattr(tree_pool, "MOST_BYTES", 0)
            assert_equal(expected, other.step(actions))
        most = max(most, len(pool))
        assert len(other._simulator._ways._others) <= 2 * number
    assert (most == 0) if few == 0 else (number < most <= 3 * number)


def test_trees_of_fields_that_are_flown_once_are_forgotten() -> None:
    env = ObstacleField(rays=3, way=1)
    most = 0
    for seed in range(150):
        env.reset(seed=seed, options={"field": get_field("sparse/train:0")})
        most = max(most, len(env._simulator._ways._pool))
    assert 10 < most < 80


def test_environments_are_freed_without_the_garbage_collector() -> None:
    envs = VectorObstacleField(2, fields=3, **WAY)
    envs.reset(seed=0)
    simulator = weakref.ref(envs._simulator)
    gc.disable()
    try:
        del envs
        assert simulator() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("few", [200, 0])
def test_copies_of_vectors_go_on_exactly(
    mode: AutoresetMode, few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(distance_to_goal, "FEW", few)
    arguments = {**WAY, "suite": "sparse", "segments": 3, "capacity": 100, "reference": few > 0}
    envs = [VectorObstacleField(3, mode, fields=50, **arguments)]
    envs[0].reset(seed=4, options={"field": [None, "traps/train:1", None]})
    stream = np.random.default_rng(3)
    for k in range(12):
        if k in (1, 6):
            envs.append(copy.deepcopy(envs[-1]) if k == 1 else pickle.loads(pickle.dumps(envs[0])))
        actions = drawn(stream, 3)
        results = [one.step(actions.copy()) for one in envs]
        over = results[0][2] | results[0][3]
        for other in results[1:]:
            assert_equal(results[0], other)
        if mode is AutoresetMode.DISABLED and over.any():
            begun = [one.reset(options={"reset_mask": over.copy()}) for one in envs]
            for other in begun[1:]:
                assert_equal(begun[0], other)


def test_among_many_discs_vector_and_scalar_environments_show_the_same() -> None:
    stream = np.random.default_rng(0)
    discs = Obstacles.discs(stream.uniform(0.0, 100.0, (450, 2)), stream.uniform(0.3, 1.0, 450))
    free = (discs.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])) > 3.0).all(axis=0)
    field = Field(name="many", obstacles=discs.only(free))
    assert len(field.obstacles) > distance_to_goal.FEW
    env = ObstacleField(fields=field, **WAY)
    envs = VectorObstacleField(2, AutoresetMode.SAME_STEP, fields=[field, ENCLOSED], **WAY)
    seen, info = env.reset(seed=0)
    shown, infos = envs.reset(seed=0)
    for action in flight(field):
        assert env.observation_space.contains(seen)
        np.testing.assert_array_equal(shown["way"][0], seen["way"])
        assert infos["shortest"][0] == info["shortest"] == exact_length(field)
        seen, reward, *_, info = env.step(action)
        shown, rewards, *_, infos = envs.step(np.stack([action, np.zeros(4, np.float32)]))
        assert rewards[0] == reward
    assert info["is_success"]
    assert infos["final_info"]["is_success"][0]
    np.testing.assert_array_equal(infos["final_obs"][0]["way"], seen["way"])
