"""Matrix products in single precision, compiled: a row has the same answer in any batch.

A network's answer must not depend on what else it is asked at the same time, or flights would
depend on how many are in the air. Libraries of matrix products sum in another order for another
number of rows, and even for another place among the same number of rows. Here each element is a
sum in the order of its terms, and each product and each sum is rounded once, so that it is the
same in any batch and on any processor.
"""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Single
from ferguson_gym.runtime.jit import compiled

ROWS = 4
"""Rows that are worked on together, so that each weight is read once for all of them."""


@compiled
def add_product(given: Single, weights: Single, sums: Single) -> None:
    """Add a product to sums.

    Args:
        given: (n, in) or larger; the rest is not read.
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
def affine(given: Single, weights: Single, bias: Single) -> Single:
    """A layer of a network: (n, out), where `weights` is (in, out) and `bias` (out,)."""
    sums = np.empty((len(given), len(bias)), np.float32)
    for i in range(len(given)):
        for j in range(len(bias)):
            sums[i, j] = bias[j]
    add_product(given, weights, sums)
    return sums
