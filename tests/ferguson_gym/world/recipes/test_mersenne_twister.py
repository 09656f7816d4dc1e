"""The stream of NumPy's RandomState, for several keys at once."""

import numpy as np
import pytest

from ferguson_gym.world.recipes.mersenne_twister import LANES, WORDS, first_doubles, seed

LARGEST = 2**32 - 1


def doubles(keys: np.ndarray, number: int) -> np.ndarray:
    state, drawn = np.empty((WORDS, LANES), np.uint32), np.full((number, LANES), np.nan)
    seed(state, keys.astype(np.uint32))
    first_doubles(state, drawn)
    return drawn


# a state of 624 words makes 312 doubles
@pytest.mark.parametrize("number", [0, 1, 311, 312, 313, 1050, 3780])
def test_numbers_are_those_of_random_state(number: int) -> None:
    stream = np.random.default_rng(number)
    for _ in range(8):
        keys = stream.integers(0, LARGEST, (LANES, 4), endpoint=True)
        drawn = doubles(keys, number)
        for lane, key in enumerate(keys):
            same = np.random.RandomState(key).random_sample(number)
            np.testing.assert_array_equal(drawn[:, lane], same)


@pytest.mark.parametrize("length", [2, 3, 4, 623, 624])
def test_keys_have_any_length_and_number(length: int) -> None:
    keys = np.zeros((LANES, length), np.int64)
    keys[1] = LARGEST
    keys[2:] = np.random.default_rng(length).integers(0, 5, (LANES - 2, length))
    drawn = doubles(keys, 700)
    for lane, key in enumerate(keys):
        np.testing.assert_array_equal(drawn[:, lane], np.random.RandomState(key).random_sample(700))
