"""Gaps between discs, by which `pursuit` limits its margins."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled


@compiled
def least_gaps(centers: Array, radii: Array, narrowest: float, widest: float) -> Array:
    """Width (n,) of the narrowest gap beside each disc, of those in a range [m]; or infinity.

    Discs are swept in the order of their left ends, so that only those that the same vertical line
    nearly meets are compared. A gap narrower than the range is closed with or without a margin.
    """
    left = centers[:, 0] - radii
    order = np.argsort(left)
    least = np.full(len(radii), np.inf)
    for place in range(len(order)):
        i = order[place]
        for k in range(place + 1, len(order)):
            j = order[k]
            if left[j] > centers[i, 0] + radii[i] + widest:
                break
            dx, dy = centers[i, 0] - centers[j, 0], centers[i, 1] - centers[j, 1]
            apart = np.sqrt(dx * dx + dy * dy)
            # both orders of subtraction, whose rounding differs
            one, other = apart - radii[i] - radii[j], apart - radii[j] - radii[i]
            if narrowest <= one < least[i]:
                least[i] = one
            if narrowest <= other < least[j]:
                least[j] = other
    return least
