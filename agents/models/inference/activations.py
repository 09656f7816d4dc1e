"""Exponentials and activations in single precision, compiled: alike wherever a number stands.

A library's exponential may differ in the last bit with the place of a number in an array, or with
the processor. Here everything is made of single operations of IEEE arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.jit import compiled

Single: TypeAlias = NDArray[np.float32]

_LEAST, _MOST = np.float32(-87.0), np.float32(88.0)
"""Between them exponentials are normal numbers."""
_LOG2E = np.float32(1.0 / np.log(2.0))
_HIGH = np.float32(0.693359375)
"""Log 2 with few digits, so that its small multiples are exact."""
_LOW = np.float32(np.log(2.0) - 0.693359375)
_ZERO, _HALF, _ONE, _TWO = (np.float32(value) for value in (0.0, 0.5, 1.0, 2.0))
_BIAS, _MANTISSA = 127, 23
"""How single numbers are stored: what is added to an exponent, and how many bits are behind it."""
_ROOT = np.float32(np.sqrt(0.5))
_T2, _T3, _T4, _T5, _T6, _T7 = (np.float32(1.0 / n) for n in (2, 6, 24, 120, 720, 5040))
_ERF = np.float32(0.3275911)
_E1, _E2, _E3, _E4, _E5 = (
    np.float32(value)
    for value in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
)


@compiled
def exponential(x: np.float32) -> np.float32:
    """Exp(x) to two units in the last place; of what is beyond -87 or 88, as of these."""
    y = x if x > _LEAST else _LEAST
    y = y if y < _MOST else _MOST
    n = np.floor(y * _LOG2E + _HALF)
    r = (y - n * _HIGH) - n * _LOW
    # |r| is at most half of log 2: Taylor's next term is below 2^-27
    series = _T4 + r * (_T5 + r * (_T6 + r * _T7))
    series = _ONE + r * (_ONE + r * (_T2 + r * (_T3 + r * series)))
    power = np.int32((np.int32(n) + _BIAS) << _MANTISSA).view(np.float32)  # two to the n
    return np.float32(series * power) if x == x else x  # NaN stays NaN


@compiled
def _tanh(values: Single) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = _ONE - _TWO / (exponential(_TWO * flat[i]) + _ONE)


@compiled
def relu(values: Single) -> None:
    """Put zero in place of what is negative."""
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = _ZERO if flat[i] < _ZERO else flat[i]


@compiled
def _silu(values: Single) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = flat[i] / (_ONE + exponential(-flat[i]))


@compiled
def _elu(values: Single) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = flat[i] if flat[i] > _ZERO else exponential(flat[i]) - _ONE


@compiled
def _gelu(values: Single) -> None:
    """Each times the share of a standard normal distribution below it, to 2e-7.

    Reference:
        Abramowitz & Stegun (1964), Handbook of mathematical functions, 7.1.26: erf.
    """
    flat = values.reshape(-1)
    for i in range(len(flat)):
        z = abs(flat[i]) * _ROOT
        t = _ONE / (_ONE + _ERF * z)
        series = t * (_E1 + t * (_E2 + t * (_E3 + t * (_E4 + t * _E5))))
        below = _HALF * series * exponential(-z * z)
        flat[i] *= below if flat[i] < _ZERO else _ONE - below


ACTIVATIONS: dict[str, Callable[[Single], None]] = {
    "elu": _elu,
    "gelu": _gelu,
    "relu": relu,
    "silu": _silu,
    "tanh": _tanh,
}
"""By name: each changes all elements of an array in place."""
