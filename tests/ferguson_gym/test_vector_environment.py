"""The vector environment against scalar ones: every number, in every mode, on any threads."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation import batch_simulator
from ferguson_gym.simulation.settings import INFOS
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.suites import SUITES, suite_field

FEW = 8
"""Fields that later resets draw from; each scalar environment holds its own."""
KINDS: dict[str, dict] = {
    "discs": {"observation": "discs", "nearest": 7, "focus": 6.0},
    "rays": {"observation": "rays", "rays": 13},
    "way": {"rays": 5, "way": 4, "progress": "way", "reference": True, "margin": 1.2},
}
DTYPES = {"is_success": bool, "outcome": np.int64, "segments": np.int64}
# the goal lies straight ahead, so that flights without steering reach it
NEAR = Field(name="near", obstacles=Obstacles.discs([[60.0, 40.0]], [5.0]), goal=[13.0, 13.0])


def pair(number: int, mode: AutoresetMode, **arguments: Any) -> tuple:
    """A vector environment, and as many scalar ones, stepped one after the other."""
    arguments = {"fields": FEW, **arguments}
    scalars = [lambda: ObstacleField(**arguments)] * number
    return (
        VectorObstacleField(number, autoreset_mode=mode, **arguments),
        SyncVectorEnv(scalars, autoreset_mode=mode),
    )


def drawn(stream: np.random.Generator, number: int) -> np.ndarray:
    """Actions: none, small ones and large ones, some on the edge of what is allowed."""
    spread = stream.choice([0.0, 0.03, 0.2, 1.0], (number, 1), p=[0.2, 0.4, 0.3, 0.1])
    actions = stream.uniform(-1.0, 1.0, (number, 4)) * spread
    actions[stream.random(actions.shape) < 0.01] = -1.0
    return actions.astype(np.float32)


def assert_same(mine: np.ndarray, theirs: np.ndarray, what: str) -> None:
    """Bit for bit."""
    assert mine.dtype == theirs.dtype, what
    assert mine.shape == theirs.shape, what
    if mine.tobytes() != theirs.tobytes():
        np.testing.assert_array_equal(mine, theirs, what)
        raise AssertionError(f"{what}: zeros of another sign")


def assert_same_seen(mine: dict, theirs: dict) -> None:
    assert set(mine) == set(theirs)
    for key, value in mine.items():
        assert_same(value, theirs[key], key)


def assert_same_infos(mine: dict, theirs: dict) -> None:
    """Equal in every key, entry and mask, also where a mask says that nothing is known."""
    assert set(mine) == set(theirs)
    for key, value in theirs.items():
        if key == "final_info":
            assert_same_infos(mine[key], value)
        elif key == "final_obs":
            for one, other in zip(mine[key], value, strict=True):
                assert (one is None) == (other is None)
                if other is not None:
                    assert_same_seen(one, other)
        else:
            assert_same(mine[key], value, key)


def assert_same_results(mine: tuple, theirs: tuple) -> None:
    assert_same_seen(mine[0], theirs[0])
    for one, other, what in zip(
        mine[1:-1], theirs[1:-1], ("reward", "terminated", "truncated"), strict=False
    ):
        assert_same(one, other, what)
    assert_same_infos(mine[-1], theirs[-1])


def assert_same_flights(mine: VectorObstacleField, theirs: SyncVectorEnv) -> None:
    """What is not returned, but can be asked for."""
    for i, env in enumerate(theirs.envs):
        assert mine.field(i).name == env.field.name
        one, other = mine.state(i), env.state
        assert one.segments == other.segments
        assert_same(one.position, other.position, "position")
        assert_same(one.derivative, other.derivative, "derivative")
        assert_same(mine.control(i), env.control, "control")
        refused = mine.refused(i)
        assert (refused is None) == (env.refused is None)
        if refused is not None:
            assert_same(refused, env.refused, "refused")


def fly_side_by_side(mine: VectorObstacleField, theirs: SyncVectorEnv, steps: int) -> set[Outcome]:
    """Fly the same actions in both; returns the outcomes that came up."""
    stream, number = np.random.default_rng(steps), mine.num_envs
    seen = set()
    for k in range(steps):
        actions = drawn(stream, number)
        results = mine.step(actions)
        assert_same_results(results, theirs.step(actions))
        infos, over = results[-1], results[2] | results[3]
        seen |= set(infos.get("final_info", infos)["outcome"].tolist())
        if mine.autoreset_mode is AutoresetMode.DISABLED and over.any():
            seeds = [int(stream.integers(100)) if i % 3 == 0 else None for i in range(number)]
            again = [
                envs.reset(seed=seeds if k % 2 else None, options={"reset_mask": over.copy()})
                for envs in (mine, theirs)
            ]
            assert_same_results(*again)
        if k % 10 == 0:
            assert_same_flights(mine, theirs)
    return {Outcome.from_code(code) for code in seen}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suite", SUITES)
def test_every_suite_is_flown_as_by_scalar_environments(suite: str, kind: str) -> None:
    mode = AutoresetMode.NEXT_STEP if kind == "discs" else AutoresetMode.SAME_STEP
    envs = pair(5, mode, suite=suite, segments=9, **KINDS[kind])
    assert_same_results(*(each.reset(seed=11) for each in envs))
    fly_side_by_side(*envs, steps=150)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(
    ("number", "steps", "kind"),
    [(1, 300, "discs"), (5, 200, "rays"), (6, 100, "way"), (70, 40, "discs")],
)
def test_every_mode_is_that_of_scalar_environments(
    mode: AutoresetMode, number: int, steps: int, kind: str
) -> None:
    envs = pair(number, mode, segments=5, detour=0.3, failure=0.7, gate=2.0, **KINDS[kind])
    assert_same_results(*(each.reset(seed=3) for each in envs))
    # once more, through a field whose goal is near: it is reached, too
    assert_same_results(*(each.reset(options={"field": NEAR}) for each in envs))
    outcomes = fly_side_by_side(*envs, steps=steps)
    assert outcomes >= {Outcome.COLLISION, Outcome.OUT_OF_SEGMENTS} or number == 1
    assert Outcome.GOAL_REACHED in outcomes or number == 1


@pytest.mark.parametrize("mode", AutoresetMode)
def test_later_resets_draw_the_fields_that_scalar_environments_draw(mode: AutoresetMode) -> None:
    mine, theirs = pair(4, mode, fields=10_000, suite="sparse")
    names = set()
    # without a seed again, with some seeds, and with the same ones
    for seed in (7, None, None, [5, None, None, 9], None, [None, 0, 2**40, None], None, 7, None):
        assert_same_results(mine.reset(seed=seed), theirs.reset(seed=seed))
        names |= {mine.field(i).name for i in range(4)}
        assert_same_flights(mine, theirs)
        if seed is not None:
            known = [seed + i for i in range(4)] if isinstance(seed, int) else seed
            for i, one in enumerate(known):
                assert one is None or mine.field(i).name == f"sparse/train:{one}"
                assert one is None or mine.np_random_seed[i] == one
    assert len(names) > 20
    assert [one.bit_generator.state for one in mine.np_random] == [
        env.np_random.bit_generator.state for env in theirs.envs
    ]
    # more resets than seeds are drawn at a time
    for _ in range(batch_simulator.FIRST_BLOCK + batch_simulator.BLOCK + 1):
        mine.reset()
        theirs.reset()
    assert_same_flights(mine, theirs)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_successes_of_ended_flights_are_counted_once(mode: AutoresetMode) -> None:
    envs = VectorObstacleField(3, mode, segments=4)
    near = [NEAR, None, None]
    envs.reset(seed=0, options={"field": near})
    ahead = np.array([[0.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0] * 4], np.float32)
    successes, ended = 0, 0
    for _ in range(12):
        *_, terminated, truncated, infos = envs.step(ahead)
        over = terminated | truncated
        ended += over.sum()
        if mode is AutoresetMode.SAME_STEP:
            successes += infos["final_info"]["is_success"].sum() if over.any() else 0
        else:
            successes += infos["is_success"].sum()
        if mode is AutoresetMode.DISABLED and over.any():
            *_, infos = envs.reset(options={"reset_mask": over})
            for key in INFOS:  # nothing of those that were not reset
                assert not infos[key][~over].any()
                np.testing.assert_array_equal(infos[f"_{key}"], over)
    assert successes == 1
    assert ended > 8


@pytest.mark.parametrize("first", ["np_random", "np_random_seed"])
def test_streams_are_seeded_before_a_reset_as_those_of_scalar_environments(first: str) -> None:
    envs = VectorObstacleField(3, fields=100)
    getattr(envs, first)
    seeds, streams = envs.np_random_seed, envs.np_random
    assert len(set(seeds)) == len(streams) == 3
    assert envs.np_random_seed == seeds
    with pytest.raises(RuntimeError, match="call reset"):
        envs.field(0)
    scalars = []
    for seed in seeds:
        scalars.append(ObstacleField(fields=100))
        scalars[-1].np_random = np.random.default_rng(seed)
    for _ in range(3):  # a reset without a seed goes on with these streams
        envs.reset()
        for i, scalar in enumerate(scalars):
            scalar.reset()
            assert envs.field(i).name == scalar.field.name
    assert envs.np_random_seed == seeds
    envs.reset(seed=5)
    assert envs.np_random_seed == (5, 6, 7)


def test_a_seed_repeats_the_same_draws() -> None:
    envs = VectorObstacleField(2)

    def names(seed: int | None) -> list[str]:
        envs.reset(seed=seed)
        return [envs.field(i).name for i in range(2)]

    first = [names(seed) for seed in (7, None, None, None)]
    assert [names(seed) for seed in (3, None, 7, None, None, None)][2:] == first


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(
    "drawn", [batch_simulator.FIRST_BLOCK, batch_simulator.FIRST_BLOCK + batch_simulator.BLOCK]
)
@pytest.mark.parametrize("more", [-2, -1, 0, 1])
def test_an_autoreset_takes_the_field_that_a_reset_would(
    mode: AutoresetMode, drawn: int, more: int
) -> None:
    envs, scalar = VectorObstacleField(1, mode), ObstacleField()
    for one in (envs, scalar):
        one.reset(seed=2)
        for _ in range(drawn + more):
            one.reset()
    back = np.array([[-1.0, 0.0, 0.0, 0.0]], np.float32)
    for _ in range(4):
        envs.step(back)
        if mode is AutoresetMode.NEXT_STEP:
            envs.step(back)
        scalar.reset()
        assert envs.field(0).name == scalar.field.name


def test_without_a_seed_environments_differ_from_each_other_and_from_the_last_time() -> None:
    names = set()
    for _ in range(2):
        envs = VectorObstacleField(4)
        envs.reset()
        names |= {envs.field(i).name for i in range(4)}
    assert len(names) >= 7


def test_a_list_of_fields_is_flown_each_by_its_environment() -> None:
    one, other = suite_field("dense", "test", 1), suite_field("sparse", "test", 2)
    envs = VectorObstacleField(4, capacity=70)
    scalars = [ObstacleField() for _ in range(4)]
    for fields, seed in (([one, None, "paper:3", other], 50), ([None, other, one, None], None)):
        seen, _ = envs.reset(seed=seed, options={"field": fields})
        for i, env in enumerate(scalars):
            options = None if fields[i] is None else {"field": fields[i]}
            expected, _ = env.reset(seed=None if seed is None else seed + i, options=options)
            for key, value in expected.items():
                assert_same(seen[key][i], value, key)
            assert envs.field(i).name == env.field.name
    mask = np.array([False, True, True, False])
    before = [envs.field(i).name for i in range(4)]
    envs.reset(options={"field": [one, one, None, one], "reset_mask": mask})
    assert [envs.field(0).name, envs.field(3).name] == [before[0], before[3]]
    assert envs.field(1) is one
    assert envs.field(2).name.startswith("standard/train:")


def returned(value: Any) -> list[np.ndarray]:
    """Every array of numbers in something returned."""
    if isinstance(value, dict):
        return [array for one in value.values() for array in returned(one)]
    if isinstance(value, tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [array for one in value for array in returned(one)]
    return [value] if isinstance(value, np.ndarray) else []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", AutoresetMode)
def test_returned_arrays_do_not_change_and_may_be_overwritten(
    mode: AutoresetMode, kind: str
) -> None:
    number = 6
    one, other = (
        VectorObstacleField(number, mode, fields=FEW, segments=6, **KINDS[kind]) for _ in range(2)
    )
    kept, copies, asked = [], [], []

    def both(call: Callable[[VectorObstacleField], tuple]) -> tuple:
        mine, twin = call(one), call(other)
        assert_same_results(mine, twin)
        kept.append(mine)
        copies.append(copy.deepcopy(mine))
        for array in returned(twin):
            array[...] = 77  # the twin's user writes into what it got
        return copies[-1]

    stream = np.random.default_rng(1)
    both(lambda envs: envs.reset(seed=1))
    for _ in range(80):
        actions = drawn(stream, number)
        given = {id(one): actions, id(other): actions.copy()}
        results = both(lambda envs, given=given: envs.step(given[id(envs)]))
        given[id(other)][:] = 55.0
        state = one.state(0)
        arrays = (state.position, state.derivative, one.control(0), one.refused(0))
        asked += [(array, array.copy()) for array in arrays if array is not None]
        *_, terminated, truncated, infos = results
        if mode is AutoresetMode.DISABLED and (over := terminated | truncated).any():
            both(lambda envs, over=over: envs.reset(options={"reset_mask": over.copy()}))
        for key in INFOS:
            for holder in (infos, infos.get("final_info", infos)):
                assert holder[key].shape == holder[f"_{key}"].shape == (number,)
                assert holder[key].dtype == DTYPES.get(key, np.float64)
                assert holder[f"_{key}"].dtype == bool
    for mine, before in zip(kept, copies, strict=True):
        assert_same_results(mine, before)
    for array, before in asked:
        assert_same(array, before, "asked for")
    arrays = [array for mine in kept for array in returned(mine)]
    for array in arrays:
        assert array.flags.writeable
    memory = {array.__array_interface__["data"][0] for array in arrays}
    assert len(memory) == len(arrays)
