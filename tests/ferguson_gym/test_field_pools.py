"""Fields of one's own: resets draw from a pool of names, files and fields."""

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.field_pool import MAX_FIELDS, FieldPool
from ferguson_gym.world.obstacles import Obstacles

ONE = Field(name="one", obstacles=Obstacles.discs([[30.0, 30.0]], [4.0]))
WIDE = Field(
    name="wide",
    obstacles=Obstacles.discs(np.full((60, 2), 150.0), np.ones(60)),
    start=[5.0, 5.0],
    goal=[190.0, 150.0],
    bounds=[0.0, 200.0],
)


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    for k, name in enumerate(("a", "b", "c")):
        centers = [[20.0 + 10.0 * k, 60.0]]
        (tmp_path / f"{name}.json").write_text(json.dumps({"centers": centers, "radii": [3.0]}))
    (tmp_path / "notes.txt").write_text("no field")
    return tmp_path


def names_of(env: ObstacleField, number: int = 60) -> set[str]:
    names = set()
    for _ in range(number):
        env.reset()
        names.add(env.field.name)
    return names


def test_resets_draw_from_whatever_names_fields(directory: Path) -> None:
    for given, expected in (
        ("forest/validation:3-5", [f"forest/validation:{k}" for k in (3, 4, 5)]),
        ("paper:1-2", ["paper:1", "paper:2"]),
        (directory, ["a", "b", "c"]),
        (str(directory / "b.json"), ["b"]),
        (ONE, ["one"]),
        (
            ["paper:4", directory / "c.json", ONE, "traps/test:9", WIDE],
            "paper:4 c one traps/test:9 wide",
        ),
        (iter(["paper:1", ("paper:2")]), ["paper:1", "paper:2"]),
        (FieldPool.of(["dense/train:7", ONE]), ["dense/train:7", "one"]),
    ):
        expected = expected.split() if isinstance(expected, str) else expected
        env = ObstacleField(fields=given)
        assert names_of(env) == set(expected)
        # a seed chooses a field, in order and round
        for seed in (*range(len(expected)), len(expected), 10**9 * len(expected) + 1):
            env.reset(seed=seed)
            assert env.field.name == expected[seed % len(expected)]


def test_a_field_of_a_pool_is_flown_with_its_own_start_and_goal() -> None:
    env = ObstacleField(fields=[WIDE, "paper:1"])
    for _ in range(8):
        _, info = env.reset()
        field = env.field
        np.testing.assert_array_equal(env.state.position, field.start)
        assert info["clearance"] == field.obstacles.signed_distance(field.start).min()
    env.reset(seed=0)
    assert env.field is WIDE


@pytest.mark.parametrize("mode", AutoresetMode)
def test_native_environments_draw_as_scalar_ones_do(mode: AutoresetMode) -> None:
    pool = [ONE, "paper:1-4", "sparse/train:0-9", WIDE]
    envs = gym.make_vec(ENVIRONMENT_ID, num_envs=3, autoreset_mode=mode, fields=pool).unwrapped
    scalars = [ObstacleField(fields=pool) for _ in range(3)]
    back = np.tile(np.array([-1.0, 0.0, 0.0, 0.0], np.float32), (3, 1))
    for k in range(100):
        seed = 14 if k % 30 == 0 else None
        envs.reset(seed=seed)
        for i, one in enumerate(scalars):
            one.reset(seed=None if seed is None else seed + i)
        assert [field.name for field in envs.get_attr("field")] == [
            one.field.name for one in scalars
        ]
        if mode is not AutoresetMode.DISABLED:
            for _ in range(2 if mode is AutoresetMode.NEXT_STEP else 1):
                envs.step(back)
            for one in scalars:
                one.reset()
            assert [envs.field(i).name for i in range(3)] == [one.field.name for one in scalars]


def test_a_pool_can_be_changed_between_flights(directory: Path) -> None:
    env = ObstacleField()
    env.reset(seed=0)
    env.fields = "paper:1-2"
    assert env.field.name == "standard/train:0"
    assert names_of(env) == {"paper:1", "paper:2"}
    env.reset(options={"fields": directory})
    assert names_of(env) == {"a", "b", "c"}
    env.reset(options={"fields": 2, "suite": "dense"})
    assert names_of(env) == {"dense/train:0", "dense/train:1"}
    envs = VectorObstacleField(2)
    envs.set_attr("fields", ["paper:1", WIDE])
    envs.reset()
    assert [field.name for field in envs.get_attr("field")] == ["paper:1", "wide"]


def test_files_are_read_once_and_copies_keep_their_fields(directory: Path) -> None:
    env = ObstacleField(fields=directory)
    for file in directory.iterdir():
        file.unlink()
    env.reset(seed=1)
    again, other = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    assert again.settings is env.settings
    for _ in range(20):
        for one in (env, again, other):
            one.reset()
        assert env.field.name == again.field.name == other.field.name


def test_a_pool_knows_its_fields_by_number() -> None:
    pool = FieldPool.of(["paper:1-4", "forest/train:0-999", ONE])
    assert len(pool) == 1005
    assert pool.max_obstacles == 180
    assert [pool[k].name for k in (0, 3, 4, 1003, 1004)] == [
        "paper:1",
        "paper:4",
        "forest/train:0",
        "forest/train:999",
        "one",
    ]
    np.testing.assert_array_equal(
        pool[8].obstacles.centers, get_field("forest/train:4").obstacles.centers
    )
    assert repr(pool) == "FieldPool(1005 fields, the first paper:1)"
    assert pool == FieldPool.of(pool)
    assert FieldPool.of("forest/train:0-9") == FieldPool.of("forest/train:0-9")
    for wrong in (-1, 1005):
        with pytest.raises(IndexError, match=f"the pool has fields 0 to 1004, not {wrong}"):
            pool[wrong]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([], f"resets draw from 1 to {MAX_FIELDS} fields, got 0"),
        (f"standard/train:0-{MAX_FIELDS}", f"got {MAX_FIELDS + 1}"),
        ("jungle/train:3", "unknown suite 'jungle'"),
        ("nowhere.json", "no such field file: 'nowhere.json'"),
        ([3], "a Field, a name or a path, or a list of these, got 3"),
        ({"paper:1": 2, "b": 3}, "unknown field 'b'"),
        ("", "a field needs a name"),
    ],
)
def test_what_names_no_field_is_refused(given: Any, message: str) -> None:
    for make in (ObstacleField, VectorObstacleField):
        with pytest.raises(ValueError, match=message):
            make(fields=given)


@pytest.mark.parametrize("name", ["obstacles", "radii"])
def test_arguments_that_change_a_suite_are_refused_beside_a_pool(name: str) -> None:
    value = {"obstacles": 9, "radii": (1, 2)}[name]
    with pytest.raises(ValueError, match=f"{name} changes the fields of a suite, .* leave {name}"):
        ObstacleField(**{"fields": "paper:1", name: value})


def test_a_pool_of_more_obstacles_than_the_capacity_is_refused() -> None:
    with pytest.raises(ValueError, match="up to 60 obstacles, more than capacity=50"):
        VectorObstacleField(2, fields=[WIDE], capacity=50)
    space = Field(
        name="space",
        obstacles=Obstacles.discs(np.empty((0, 3)), []),
        start=np.zeros(3),
        goal=np.ones(3) * 9,
    )
    with pytest.raises(ValueError, match="flights are planar, field space has 3 dimensions"):
        ObstacleField(fields=[space])
