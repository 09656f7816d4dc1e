"""Fields that resets draw: what is in the store, and when it is put there."""

from typing import Any

import numpy as np
import pytest

from ferguson_gym.simulation import drawn_fields
from ferguson_gym.simulation.batch_simulator import FIRST_BLOCK
from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.suites import stream_keys


@pytest.mark.parametrize("corners", [0, 130])
@pytest.mark.parametrize("obstacles", [0, 1, 50])
def test_fields_put_together_are_those_put_alone(corners: int, obstacles: int) -> None:
    settings, slots = Settings(obstacles=obstacles), np.array([4, 1, 11, 0])
    recipe = settings.scattered
    assert recipe is not None
    one, other = FieldStore(12, 53, corners), FieldStore(12, 53, corners)
    seeds = np.array([5, 0, 9_999, 77])
    one.put_discs(slots, recipe, stream_keys("standard", "train", seeds))
    for slot, seed in zip(slots.tolist(), seeds.tolist(), strict=True):
        other.put_obstacles(slot, settings.drawn(seed))
    assert one.used == other.used == 12
    for mine, its in zip(one.arrays, other.arrays, strict=True):
        np.testing.assert_array_equal(mine, its)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Seeds of the fields that are made."""
    seeds: list[int] = []
    usual = drawn_fields._put

    def put(store: FieldStore, slots: Any, settings: Settings, given: Any) -> None:
        seeds.extend(given.tolist())
        usual(store, slots, settings, given)

    monkeypatch.setattr(drawn_fields, "_put", put)
    return seeds


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_many_vehicles_have_their_fields_made_by_the_reset(mode: str, made: list[int]) -> None:
    envs = VectorObstacleField(3, mode, fields=3 * FIRST_BLOCK)
    envs.reset()
    assert sorted(made) == list(range(3 * FIRST_BLOCK))
    if mode != "Disabled":
        for _ in range(3):
            envs.step(np.full((3, 4), -1.0, np.float32))
    envs.reset()
    assert len(made) == 3 * FIRST_BLOCK


def test_few_vehicles_have_the_fields_made_that_they_need(made: list[int]) -> None:
    envs = VectorObstacleField(3, fields=3 * FIRST_BLOCK + 1)
    envs.reset(seed=0)
    assert made == [0, 1, 2]
    envs.step(np.zeros((3, 4), np.float32))
    assert 3 < len(made) < 3 + 3 * FIRST_BLOCK
    assert len(set(made[3:])) == len(made) - 3  # each once, beside those asked for


def test_seeds_whose_fields_were_not_made_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    envs, twin = VectorObstacleField(2, fields=1000), VectorObstacleField(2, fields=1000)
    for one in (envs, twin):
        one.reset(seed=0)
    with monkeypatch.context() as patch:
        patch.setattr(drawn_fields, "_put", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            envs.step(np.zeros((2, 4), np.float32))
    ends = np.full((2, 4), -1.0, np.float32)
    for _ in range(FIRST_BLOCK):
        seen, same = envs.step(ends), twin.step(ends)
        np.testing.assert_array_equal(seen[1], same[1])
        assert [envs.field(i).name for i in (0, 1)] == [twin.field(i).name for i in (0, 1)]
