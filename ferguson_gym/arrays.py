"""Array types, and the one check through which arrays from outside enter."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers, double precision."""

GenericArray: TypeAlias = NDArray[Any]
"""Real or complex numbers: functions typed so can be differentiated by complex step."""


def finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as a C-contiguous float64 array after checking shape and finiteness.

    Args:
        name: what the array is called in the error.
        value: anything NumPy can read.
        shape: expected shape; None stands for any size along that axis.

    Raises:
        ValueError: not numeric, another shape, or an entry that is NaN or infinite.
    """
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of numbers: {error}") from None
    if np.ndim(value) == 0:
        array = array.reshape(())
    if len(array.shape) != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        wanted = "(" + ", ".join("n" if size is None else str(size) for size in shape) + ")"
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]} in it")
    return array


def frozen(array: Array) -> Array:
    """Return a read-only copy, for the fields of frozen dataclasses."""
    copy = np.array(array, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy
