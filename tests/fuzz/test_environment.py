"""The environments: no action, reset, setting or wrapper brings one down."""

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import ClipAction, FlattenObservation, RecordEpisodeStatistics
from hypothesis import strategies as st

import ferguson_gym
from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import (
    ACTIONS,
    JSON,
    NO_ARRAYS,
    WILD,
    arrays,
    fields,
    laid_out,
    vehicles,
)

KINDS = st.sampled_from(["discs", "rays", "both"])


@cache
def scalar(kind: str) -> ObstacleField:
    return ObstacleField(observation=kind, fields=50)


@cache
def wrapped(kind: str) -> gym.Env[Any, Any]:
    return gym.make(ferguson_gym.ENVIRONMENT_ID, observation=kind, fields=50)


@cache
def vector(mode: str) -> VectorObstacleField:
    return VectorObstacleField(3, fields=50, autoreset_mode=mode)


def is_sound(env: Any, seen: Any, reward: float, info: dict[str, Any]) -> None:
    assert env.observation_space.contains(seen)
    assert np.isfinite(reward)
    assert not np.isnan(info["clearance"])
    assert np.isfinite(info["path_length"])
    assert info["is_success"] == (info["outcome"] == Outcome.GOAL_REACHED.code)


@fuzzed(
    "environment: any action in the box",
    many=6000,
    kind=KINDS,
    seed=st.integers(0, 2**63 - 1),
    actions=st.lists(ACTIONS, min_size=1, max_size=5),
    small=st.sampled_from([1.0, 0.1]),
)
def test_any_action_in_the_box_is_flown(
    kind: str, seed: int, actions: list[np.ndarray], small: float
) -> None:
    for env in (scalar(kind), wrapped(kind)):
        env.reset(seed=seed)
        for action in actions:
            seen, reward, terminated, truncated, info = env.step(
                (small * action).astype(np.float32)
            )
            is_sound(env, seen, float(reward), info)
            if terminated or truncated:
                env.reset()


@fuzzed(
    "environment: any field",
    many=6000,
    kind=KINDS,
    field=fields(most=60),
    actions=st.lists(ACTIONS, min_size=1, max_size=4),
)
def test_any_field_is_flown(kind: str, field: Field, actions: list[np.ndarray]) -> None:
    env = scalar(kind)
    seen, info = env.reset(options={"field": field})
    is_sound(env, seen, 0.0, info)
    for action in actions:
        seen, reward, terminated, truncated, info = env.step((0.2 * action).astype(np.float32))
        is_sound(env, seen, reward, info)
        if terminated or truncated:
            return


@fuzzed(
    "environment: any state is seen",
    many=6000,
    kind=KINDS,
    field=fields(most=20),
    data=st.data(),
    focus=st.sampled_from([0.0, 10.0]),
    way=st.integers(0, 5),
    margin=st.sampled_from([0.0, 0.8, 6.0]),
)
def test_any_state_is_seen(
    kind: str, field: Field, data: Any, focus: float, way: int, margin: float
) -> None:
    settings = Settings(observation=kind, focus=focus, way=way, margin=margin)
    seen = observe(field, [data.draw(vehicles(field))], settings)
    for entry in seen.values():
        assert (np.abs(entry) <= 1.0).all()


@fuzzed(
    "environment: actions of anything",
    many=8000,
    action=NO_ARRAYS
    | arrays(4)
    | arrays(3, 4)
    | arrays(4).flatmap(laid_out)
    | arrays(4).map(lambda action: np.clip(action, -4.0, 4.0).astype(np.float32))
    | arrays(3, 4).map(lambda action: np.clip(action, -4.0, 4.0).astype(np.float32)),
)
def test_an_action_of_anything_is_flown_or_refused(action: Any) -> None:
    env, envs = scalar("discs"), vector("NextStep")
    with np.errstate(all="ignore"):
        for one in (env, envs):
            one.reset(seed=3)
            before = one.state if one is env else one.state(0)
            found = attempt(one.step, action)
            after = one.state if one is env else one.state(0)
            if found is None:
                np.testing.assert_array_equal(before.position, after.position)
            else:
                given = np.asarray(action, float)
                assert given.shape == one.action_space.shape
                assert np.abs(given).max() <= 1.0 + 1e-7


@fuzzed(
    "environment: resets of anything",
    many=6000,
    seed=NO_ARRAYS | st.integers() | st.lists(st.none() | st.integers(0, 9), max_size=4) | WILD,
    options=st.none()
    | st.just({})
    | st.dictionaries(
        st.sampled_from(["field", "reset_mask", "wind", 3]),
        NO_ARRAYS
        | st.sampled_from(["paper:1", "paper:5", "x", "standard/test:0-3", "traps/train:2"])
        | fields()
        | st.lists(fields(most=2), min_size=2, max_size=3)
        | st.lists(st.booleans(), min_size=3, max_size=3).map(np.array),
        max_size=2,
    )
    | st.sampled_from([3, "field", [1]]),
)
def test_a_reset_of_anything_starts_flights_or_is_refused(seed: Any, options: Any) -> None:
    for one in (scalar("rays"), vector("SameStep")):
        found = attempt(one.reset, seed=seed, options=options)
        if found is None:
            one.reset(seed=0)
        else:
            assert one.observation_space.contains(found[0])
        one.step(np.zeros(one.action_space.shape, np.float32))


VALUES = (
    JSON | WILD | st.integers(-3, 200) | st.sampled_from([np.int64(3), np.float32(2.5), [3, 5]])
)
ARGUMENTS = st.dictionaries(
    st.sampled_from(
        [
            *("suite", "split", "fields", "obstacles", "radii", "gate", "segments", "observation"),
            *("nearest", "focus", "rays", "view", "detour", "failure", "capacity", "wind"),
            *("way", "margin", "progress", "reference"),
        ]
    ),
    VALUES,
    max_size=4,
)
LIKELY = st.fixed_dictionaries(
    {},
    optional={
        "suite": st.sampled_from(["standard", "sparse", "forest", "traps"]),
        "obstacles": st.integers(0, 60),
        "radii": st.tuples(st.floats(0.01, 7.0), st.floats(0.01, 7.0)),
        "gate": st.floats(0.0, 3.0),
        "segments": st.integers(1, 100),
        "observation": KINDS,
        "nearest": st.integers(1, 60),
        "focus": st.floats(0.0, 30.0),
        "rays": st.integers(1, 100),
        "view": st.floats(1.0, 1000.0),
        "detour": st.floats(0.0, 100.0),
        "capacity": st.integers(0, 200),
        "way": st.integers(0, 12),
        "margin": st.floats(0.0, 10.0),
        "progress": st.sampled_from(["straight", "way"]),
        "reference": st.booleans(),
    },
)


@fuzzed("environment: settings", many=6000, given_=ARGUMENTS | LIKELY, seed=st.integers(0, 99))
def test_an_environment_is_made_and_flies_or_is_refused(given_: dict[str, Any], seed: int) -> None:
    arguments = {"fields": 3, **given_}
    if isinstance(arguments["fields"], int) and arguments["fields"] > 10_000:
        arguments["fields"] = 10_000  # memory, not input
    env = attempt(ObstacleField, **arguments)
    if env is None:
        return
    seen, info = env.reset(seed=seed)
    is_sound(env, seen, 0.0, info)
    seen, reward, _, _, info = env.step(np.zeros(4, np.float32))
    is_sound(env, seen, reward, info)
    env.reset()
    assert Settings(**arguments).field(seed).name


@fuzzed(
    "environment: vectors of any size",
    many=2000,
    number=NO_ARRAYS | st.integers(-2, 12),
    mode=st.sampled_from(["NextStep", "SameStep", "Disabled"]) | NO_ARRAYS,
    actions=arrays(12, 4, numbers=st.floats(-1.0, 1.0)),
    seed=st.integers(0, 2**40),
)
def test_vectors_fly_as_single_environments_do(
    number: Any, mode: Any, actions: np.ndarray, seed: int
) -> None:
    envs = attempt(VectorObstacleField, number, autoreset_mode=mode, fields=5)
    if envs is None:
        return
    number = envs.num_envs
    envs.reset(seed=seed)
    given_ = (0.2 * actions[:number]).astype(np.float32)
    _, rewards, terminated, truncated, infos = envs.step(given_)
    alone = scalar("discs")
    for i in range(number):
        alone.reset(seed=seed + i)
        _, reward, over, cut, info = alone.step(given_[i])
        assert (rewards[i], terminated[i], truncated[i]) == (reward, over, cut)
        known = infos["final_info"] if mode == "SameStep" and over else infos
        assert known["outcome"][i] == info["outcome"]


@fuzzed(
    "environment: wrappers",
    many=2000,
    actions=st.lists(arrays(4), min_size=1, max_size=3),
    which=st.lists(
        st.sampled_from([ClipAction, FlattenObservation, RecordEpisodeStatistics]), unique=True
    ),
)
def test_wrappers_fly(actions: list[np.ndarray], which: list[Any]) -> None:
    env: gym.Env[Any, Any] = scalar("both")
    for wrap in which:
        env = wrap(env)
    env.reset(seed=1)
    for action in actions:
        with np.errstate(all="ignore"):
            found = attempt(env.step, action.astype(np.float32))
        if found is not None:
            assert env.observation_space.contains(found[0])
            if found[2] or found[3]:
                return
