"""Chains whose segments join in points and directions; their derivatives may differ in length."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array

_JOINT = 1e-9
"""Largest mismatch at a joint: of points relative to the largest coordinate, of unit directions."""


def as_chain(control: ArrayLike) -> Array:
    """Checked segments (n, 4, D) that join in points and directions.

    A derivative of zero has no direction and fits every other.

    Raises:
        ValueError: a control array of another shape or not finite, or segments whose points or
            directions differ at their joint.
    """
    control = as_control(control)
    if control.ndim != 3 or len(control) == 0:
        raise ValueError(f"a chain has shape (n, 4, D) with n >= 1, got {control.shape}")
    if len(control) == 1:
        return control
    apart = np.abs(control[1:, 0] - control[:-1, 1]).max(axis=1)
    if apart.max() > _JOINT * np.abs(control).max():
        joint = int(apart.argmax())
        raise ValueError(
            f"segments {joint} and {joint + 1} do not join: their points differ by "
            f"{apart[joint]:.3g} m"
        )
    turn = np.abs(_directions(control[:-1, 3]) - _directions(control[1:, 2])).max(axis=1)
    turn = np.nan_to_num(turn)
    if turn.max() > _JOINT:
        joint = int(turn.argmax())
        raise ValueError(
            f"segments {joint} and {joint + 1} join with different directions: their unit vectors "
            f"differ by {turn[joint]:.3g}"
        )
    return control


def _directions(vectors: Array) -> Array:
    """Unit vectors (n, D), NaN where a vector is zero."""
    with np.errstate(invalid="ignore"):
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
