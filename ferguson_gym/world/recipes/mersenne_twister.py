"""The numbers of NumPy's `RandomState`, for several keys at once, as compiled code.

To make a `RandomState` takes longer than to draw a field. Its stream is frozen: a Mersenne Twister
seeded with an array of numbers, the key, of which two words make a double. Here LANES generators
run side by side, one for each key, so that the processor's vector instructions apply.

Reference:
    Matsumoto and Nishimura (1998), Mersenne Twister, ACM TOMACS 8(1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place

Words = NDArray[np.uint32]

LANES = 8
"""Generators that run side by side."""
WORDS, AHEAD = 624, 397
"""Words of a generator's state, and how far ahead a word is that is mixed into another one."""
_UPPER, _LOWER = np.uint32(0x80000000), np.uint32(0x7FFFFFFF)
_MATRIX = np.uint32(0x9908B0DF)
_U1, _U30 = np.uint32(1), np.uint32(30)
_BASE, _FIRST, _SECOND = np.uint32(1812433253), np.uint32(1664525), np.uint32(1566083941)


@compiled
def seed(state: Words, keys: Words) -> None:
    """Seed generators with arrays of numbers, as `RandomState(key)` does.

    Args:
        state: (WORDS, LANES), filled.
        keys: (LANES, numbers), 2 to WORDS of them; NumPy takes a single one for a plain seed.
    """
    word = np.uint32(19650218)
    for lane in range(LANES):
        state[0, lane] = word
    for i in range(1, WORDS):
        word = np.uint32(_BASE * (word ^ (word >> _U30)) + np.uint32(i))
        for lane in range(LANES):
            state[i, lane] = word
    numbers, i, j = keys.shape[1], 1, 0
    for _ in range(WORDS):
        for lane in range(LANES):
            last = state[i - 1, lane]
            mixed = np.uint32((last ^ (last >> _U30)) * _FIRST)
            state[i, lane] = np.uint32((state[i, lane] ^ mixed) + keys[lane, j] + np.uint32(j))
        i, j = i + 1, (j + 1) % numbers
        if i == WORDS:
            state[0], i = state[WORDS - 1], 1
    for _ in range(WORDS - 1):
        for lane in range(LANES):
            last = state[i - 1, lane]
            mixed = np.uint32((last ^ (last >> _U30)) * _SECOND)
            state[i, lane] = np.uint32((state[i, lane] ^ mixed) - np.uint32(i))
        i += 1
        if i == WORDS:
            state[0], i = state[WORDS - 1], 1
    state[0] = _UPPER


@compiled
def _advance(state: Words) -> None:
    """The next WORDS words."""
    for i in range(WORDS - AHEAD):
        _mix(state, i, i + 1, i + AHEAD)
    for i in range(WORDS - AHEAD, WORDS - 1):
        _mix(state, i, i + 1, i + AHEAD - WORDS)
    _mix(state, WORDS - 1, 0, AHEAD - 1)


@compiled_in_place
def _mix(state: Words, i: int, after: int, ahead: int) -> None:
    for lane in range(LANES):
        mixed = (state[i, lane] & _UPPER) | (state[after, lane] & _LOWER)
        odd = np.uint32(np.uint32(0) - (mixed & _U1))
        state[i, lane] = state[ahead, lane] ^ (mixed >> _U1) ^ (odd & _MATRIX)


@compiled
def _tempered(word: np.uint32) -> np.uint32:
    word ^= word >> np.uint32(11)
    word ^= np.uint32(word << np.uint32(7)) & np.uint32(0x9D2C5680)
    word ^= np.uint32(word << np.uint32(15)) & np.uint32(0xEFC60000)
    return np.uint32(word ^ (word >> np.uint32(18)))


@compiled
def first_doubles(state: Words, doubles: Array) -> None:
    """The first numbers (n, LANES) in [0, 1) of generators that were just seeded.

    Args:
        state: (WORDS, LANES), changed.
        doubles: filled, as by `RandomState.random_sample(n)` for each lane.
    """
    for begin in range(0, len(doubles), WORDS // 2):
        _advance(state)
        for k in range(min(WORDS // 2, len(doubles) - begin)):
            for lane in range(LANES):
                high = np.int32(_tempered(state[2 * k, lane]) >> np.uint32(5))
                low = np.int32(_tempered(state[2 * k + 1, lane]) >> np.uint32(6))
                doubles[begin + k, lane] = (high * 67108864.0 + low) / 9007199254740992.0
