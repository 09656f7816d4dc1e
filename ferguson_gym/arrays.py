"""Array types, and the one check through which arrays from outside enter."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers, double precision."""

GenericArray: TypeAlias = NDArray[Any]
"""Real or complex numbers: functions typed so can be differentiated by complex step."""


def real(name: str, value: ArrayLike) -> Array:
    """Return `value` as a C-contiguous float64 array; strings and complex numbers are refused.

    Args:
        name: what the array is called in the error.
        value: anything NumPy can read.

    Raises:
        ValueError: not an array of real numbers.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:  # ragged lists
        raise ValueError(f"{name} must be an array of numbers: {error}") from None
    if array.dtype.kind not in "biuf":  # whole numbers beyond 64 bits are objects
        raise ValueError(f"{name} must be an array of numbers, got {_shortened(value)}")
    # ascontiguousarray alone would make a number a vector
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as a C-contiguous float64 array after checking shape and finiteness.

    Args:
        name: what the array is called in the error.
        value: anything NumPy can read.
        shape: expected shape; None stands for any size along that axis.

    Raises:
        ValueError: not real numbers, another shape, or an entry that is NaN or infinite.
    """
    array = real(name, value)
    if len(array.shape) != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        sizes = ["n" if size is None else str(size) for size in shape]
        wanted = f"({sizes[0]},)" if len(sizes) == 1 else f"({', '.join(sizes)})"
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]} in it")
    return array


def frozen(array: Array) -> Array:
    """Return a read-only copy, for the fields of frozen dataclasses."""
    copy = np.array(array, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy
