"""Segment lengths for optimisers: smooth in the control array, real or complex.

Gauss-Legendre quadrature with a fixed number of nodes. For curves without a near-cusp it
agrees with the certified length to rounding; elsewhere certification finds the difference and
the constraint is corrected (see `planners.optimization.reference.exchange`).
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array, GenericArray

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_SLOPES = basis(0.5 * (_NODES + 1.0), 1)
_WEIGHTS = 0.5 * _WEIGHTS
_BEND = basis(0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0), 2)
BENDING = _BEND.T @ (0.5 * _BEND)
"""Weights (4, 4) of products of control rows in the integral of |X''|^2 over t; two Gauss
nodes are exact, since X'' is linear."""


def bending(control: GenericArray) -> GenericArray:
    """Integral of |X''(t)|^2 over t in [0, 1], summed over segments (n, 4, D): () [m^2]."""
    return np.asarray(np.sum(control * (BENDING @ control)))


def lengths(control: GenericArray) -> GenericArray:
    """Arc length [m] of segments (*batch, 4, D): (*batch,).

    Reference:
        The paper, equation (3).
    """
    tangent = _SLOPES @ control
    length: GenericArray = np.sqrt(np.sum(tangent * tangent, axis=-1)) @ _WEIGHTS
    return length


def length_gradients(control: Array) -> Array:
    """Gradient of each length with respect to its segment's control array: (n, 4, D)."""
    tangent = _SLOPES @ control
    speed = np.sqrt(np.sum(tangent * tangent, axis=-1, keepdims=True))
    unit = np.divide(tangent, speed, out=np.zeros_like(tangent), where=speed > 0.0)
    return np.asarray((_WEIGHTS[:, None] * _SLOPES).T @ unit)
