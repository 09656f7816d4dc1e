"""Trees in a pool give what each gives alone, however many there are."""

from __future__ import annotations

import numpy as np
import pytest

from ferguson_gym.guidance import tree_pool
from ferguson_gym.guidance.path_tree import PathTree
from ferguson_gym.guidance.tree_pool import TreePool
from ferguson_gym.guidance.way import Way, tree_of, with_margin
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.visibility import random_mixture

SHOWN = np.array([1.0, 12.0, 40.0])


def made(field: Field) -> PathTree:
    tree = tree_of(with_margin(field, 0.8))
    assert tree is not None
    return tree


def test_a_pool_that_grows_gives_what_each_tree_gives_alone() -> None:
    pool, stream = TreePool(), np.random.default_rng(0)
    suites = ("standard", "sparse", "traps", "dense")
    fields = [get_field(f"{suites[k % 4]}/train:{k}") for k in range(70)]
    fields[7] = Field(name="open", obstacles=Obstacles.discs([], []))
    fields[::3] = [random_mixture(k) for k in range(24)]
    assert [pool.add(made(field)) for field in fields] == list(range(70))
    assert len(pool) == 70
    which = np.append(stream.integers(70, size=200), 7)
    points = stream.uniform(0.0, 100.0, (201, 2))
    places, togo = pool.look_ahead(which, points, SHOWN[None])
    for k, number in enumerate(which.tolist()):
        if np.isinf(togo[k]):
            continue
        alone, length = Way(fields[number], 0.8).ahead(points[k : k + 1], SHOWN[None])
        np.testing.assert_array_equal(places[k], alone[0])
        assert togo[k] == length[0]
    assert np.isfinite(togo).mean() > 0.8


def test_numbers_below_zero_have_no_way() -> None:
    pool = TreePool()
    pool.add(made(get_field("sparse/train:1")))
    _, togo = pool.look_ahead(np.array([-1, 0, -2]), np.zeros((3, 2)), SHOWN[None])
    assert np.isinf(togo).tolist() == [True, False, True]


def test_a_pool_is_full_by_its_memory_and_empty_when_cleared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pool, tree = TreePool(), made(get_field("sparse/train:1"))
    monkeypatch.setattr(tree_pool, "MOST_BYTES", 2**18)
    assert not pool.is_full
    while not pool.is_full:
        assert pool.add(tree) < 200
    pool.clear()
    assert len(pool) == 0
    assert not pool.is_full
    assert pool.add(tree) == 0
