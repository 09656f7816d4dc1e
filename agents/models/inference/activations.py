"""Compiled exponential and activations in single precision, reproducible to the last bit.

A library's exponential may differ in the last bit with the position of an element in its array, or
with the processor. These kernels consist of single operations of IEEE arithmetic only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.jit import compiled

Float32Array: TypeAlias = NDArray[np.float32]

_LEAST, _MOST = np.float32(-87.0), np.float32(88.0)
"""Range in which the exponential is a normal number."""
_LOG2E = np.float32(1.0 / np.log(2.0))
_HIGH = np.float32(0.693359375)
"""Leading bits of log 2, so that small multiples are exact (Cody-Waite reduction)."""
_LOW = np.float32(np.log(2.0) - 0.693359375)
_ZERO, _HALF, _ONE, _TWO = (np.float32(value) for value in (0.0, 0.5, 1.0, 2.0))
_BIAS, _MANTISSA = 127, 23
"""Exponent bias and number of mantissa bits of a float32."""
_ROOT = np.float32(np.sqrt(0.5))
_T2, _T3, _T4, _T5, _T6, _T7 = (np.float32(1.0 / n) for n in (2, 6, 24, 120, 720, 5040))
_ERF = np.float32(0.3275911)
_E1, _E2, _E3, _E4, _E5 = (
    np.float32(value)
    for value in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
)


@compiled
def exponential(x: np.float32) -> np.float32:
    """Return exp(x) to two units in the last place, with x clamped to [-87, 88]."""
    y = x if x > _LEAST else _LEAST
    y = y if y < _MOST else _MOST
    n = np.floor(y * _LOG2E + _HALF)
    r = (y - n * _HIGH) - n * _LOW
    # |r| <= log(2) / 2, so that the next term of the Taylor series is below 2^-27
    series = _T4 + r * (_T5 + r * (_T6 + r * _T7))
    series = _ONE + r * (_ONE + r * (_T2 + r * (_T3 + r * series)))
    power = np.int32((np.int32(n) + _BIAS) << _MANTISSA).view(np.float32)  # 2^n
    return np.float32(series * power) if x == x else x  # NaN stays NaN


@compiled
def _tanh(values: Float32Array) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = _ONE - _TWO / (exponential(_TWO * flat[i]) + _ONE)


@compiled
def relu(values: Float32Array) -> None:
    """Replace negative elements by zero, in place."""
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = _ZERO if flat[i] < _ZERO else flat[i]


@compiled
def _silu(values: Float32Array) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = flat[i] / (_ONE + exponential(-flat[i]))


@compiled
def _elu(values: Float32Array) -> None:
    flat = values.reshape(-1)
    for i in range(len(flat)):
        flat[i] = flat[i] if flat[i] > _ZERO else exponential(flat[i]) - _ONE


@compiled
def _gelu(values: Float32Array) -> None:
    """Multiply each element by the standard normal distribution function there, to 2e-7.

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


ACTIVATIONS: dict[str, Callable[[Float32Array], None]] = {
    "elu": _elu,
    "gelu": _gelu,
    "relu": relu,
    "silu": _silu,
    "tanh": _tanh,
}
"""Activations by name; each works in place."""
