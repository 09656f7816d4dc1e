"""Compiled matrix products in single precision whose rows do not depend on the batch.

An action must not depend on the other rows of its batch, or a flight would depend on how many
others are flown with it. BLAS libraries change the order of summation with the number of rows and
with the position of a row. Here each element is summed in the order of its terms, and each product
and each sum is rounded once: the result is the same in any batch and on any processor.
"""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Float32Array
from ferguson_gym.runtime.jit import compiled

ROWS = 4
"""Rows computed together, so that each weight is loaded once for all of them."""


@compiled
def add_product(given: Float32Array, weights: Float32Array, sums: Float32Array) -> None:
    """Add `given @ weights` to `sums`, in place.

    Args:
        given: (n, in) or larger; further rows and columns are not read.
        weights: (in, out).
        sums: (n, out).
    """
    number, (deep, wide) = len(sums), weights.shape
    assert len(given) >= number
    assert given.shape[1] >= deep
    assert sums.shape[1] == wide
    together = number - number % ROWS
    for i in range(0, together, ROWS):
        for k in range(deep):
            for j in range(wide):
                weight = weights[k, j]
                sums[i, j] += given[i, k] * weight
                sums[i + 1, j] += given[i + 1, k] * weight
                sums[i + 2, j] += given[i + 2, k] * weight
                sums[i + 3, j] += given[i + 3, k] * weight
    for i in range(together, number):
        for k in range(deep):
            for j in range(wide):
                sums[i, j] += given[i, k] * weights[k, j]


@compiled
def affine(given: Float32Array, weights: Float32Array, bias: Float32Array) -> Float32Array:
    """Return `given @ weights + bias` (n, out) for weights (in, out) and a bias (out,)."""
    sums = np.empty((len(given), len(bias)), np.float32)
    for i in range(len(given)):
        for j in range(len(bias)):
            sums[i, j] = bias[j]
    add_product(given, weights, sums)
    return sums
