"""Scattered discs: many fields at once are those that are drawn one by one."""

import numpy as np
import pytest

from ferguson_gym.world.recipes.mersenne_twister import LANES
from ferguson_gym.world.recipes.scattered import latin_hypercube
from ferguson_gym.world.suites import LAST_SEED, SPLITS, Scattered, stream_keys


def hypercube(stream: np.random.RandomState, points: int) -> np.ndarray:
    """A design as the recipe describes it, without compiled code."""
    best, spread = np.empty((points, 2)), -1.0
    for ranks, jitter in stream.random_sample((5, 2, 2, points)):
        rank = 1 + (ranks[:, None, :] < ranks[:, :, None]).sum(axis=2)
        design = ((rank - jitter) / points).T
        offset = design[:, None] - design[None]
        square = offset[..., 0] ** 2 + offset[..., 1] ** 2
        least = square[np.tril_indices(points, -1)].min(initial=np.inf)
        if least > spread:
            best, spread = design, least
    return best


def one_by_one(recipe: Scattered, key: np.ndarray) -> np.ndarray:
    stream = np.random.RandomState(key)
    designs = [np.empty((0, 2)), *(hypercube(stream, points) for points in recipe.designs)]
    centers = 90.0 * np.vstack(designs) + 5.0
    radii = recipe.smallest + (recipe.largest - recipe.smallest) * stream.random_sample(recipe.most)
    return np.vstack([centers.T, radii])


@pytest.mark.parametrize("points", [1, 2, 5, 25])
def test_a_hypercube_is_the_best_of_five(points: int) -> None:
    streams = np.random.RandomState(points), np.random.RandomState(points)
    np.testing.assert_array_equal(
        latin_hypercube(streams[0], points), hypercube(streams[1], points)
    )
    assert streams[0].random_sample() == streams[1].random_sample()


@pytest.mark.parametrize("designs", [(), (1,), (1, 2), (25, 25), (5, 6), (60, 60, 60)])
@pytest.mark.parametrize("number", [1, LANES, 2 * LANES + 3])
def test_fields_drawn_together_are_those_drawn_alone(designs: tuple, number: int) -> None:
    recipe, stream = Scattered(designs, 0.5, 6.25), np.random.default_rng(number)
    seeds = stream.integers(0, LAST_SEED, number, endpoint=True)
    keys = stream_keys("forest", SPLITS[number % 3], seeds)
    slots = stream.permutation(3 * number)[:number]
    discs = np.full((3 * number, 3, recipe.most + 2), np.nan)
    recipe.draw_many(keys, slots, discs)
    for slot, key in zip(slots, keys, strict=True):
        np.testing.assert_array_equal(discs[slot, :, : recipe.most], one_by_one(recipe, key))
        alone = recipe(np.random.RandomState(key))
        np.testing.assert_array_equal(discs[slot, :2, : recipe.most].T, alone.centers)
        np.testing.assert_array_equal(discs[slot, 2, : recipe.most], alone.radii)
    # nothing else is written
    assert np.isnan(np.delete(discs, slots, axis=0)).all()
    assert np.isnan(discs[:, :, recipe.most :]).all()


def test_discs_that_do_not_fit_are_refused() -> None:
    keys = stream_keys("standard", "train", np.arange(2))
    with pytest.raises(ValueError, match="50 discs do not fit into 49"):
        Scattered((25, 25), 3.0, 7.0).draw_many(keys, np.arange(2), np.empty((2, 3, 49)))
