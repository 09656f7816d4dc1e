"""Array types, and the validation of arrays that users supply."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers, double precision."""

GenericArray: TypeAlias = NDArray[Any]
"""Real or complex numbers: functions typed so can be differentiated by complex step."""

LARGEST = 1e120
"""Upper limit of numbers from outside: their fourth powers are finite, as every proof needs."""

_DOUBLE = np.dtype(np.float64)


def real(name: str, value: ArrayLike, kind: str = "an array of numbers") -> Array:
    """Return `value` as a C-contiguous float64 array.

    Raises:
        ValueError: not an array of real numbers; the message names it and the `kind` expected.
    """
    if type(value) is np.ndarray and value.dtype is _DOUBLE and value.flags.c_contiguous:
        return value  # most arrays
    try:
        array = np.asarray(value)
    except ValueError as error:  # ragged lists
        raise ValueError(f"{name} must be {kind}: {error}") from None
    if array.dtype.kind not in "biuf":  # whole numbers beyond 64 bits are objects
        raise ValueError(f"{name} must be {kind}, got {truncate_repr(value)}")
    # ascontiguousarray alone would make a number a vector
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def truncate_repr(value: object, most: int = 60) -> str:
    """A value as an error shows it: on one line of at most so many characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= most else text[: most - 3] + "..."


def finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as a C-contiguous float64 array after checking shape and finiteness.

    A size of None in `shape` stands for any size along that axis.

    Raises:
        ValueError: not real numbers, another shape, or an entry that is NaN, infinite or beyond
            `LARGEST`; the message names the array.
    """
    number: object = value
    if not shape and type(number) is float and abs(number) <= LARGEST:
        return np.array(number)  # most numbers; what follows takes ten times as long
    array = real(name, value, "an array of numbers" if shape else "a number")
    if len(array.shape) != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        sizes = ["n" if size is None else str(size) for size in shape]
        wanted = f"({sizes[0]},)" if len(sizes) == 1 else f"({', '.join(sizes)})"
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
    check_size(name, array)
    return array


def check_size(name: str, array: GenericArray) -> None:
    """Refuse entries that are not finite or too large.

    Raises:
        ValueError: an entry that is NaN, infinite or beyond `LARGEST`.
    """
    if abs(np.vdot(array, array)) <= LARGEST**2:
        return  # most arrays; what follows takes several times as long
    size = np.abs(array)
    if not (size <= LARGEST).all():
        wrong = array[~(size <= LARGEST)][0]
        limit = f"at most {LARGEST:g} in size" if np.isfinite(wrong) else "finite"
        raise ValueError(f"{name} must be {limit}, got {wrong} in it")


def frozen(array: Array) -> Array:
    """Return a read-only copy, for the fields of frozen dataclasses."""
    copy = np.array(array, dtype=np.float64, order="C")
    copy.flags.writeable = False
    return copy
