"""Segments along a whole route by convex programs, all at once."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from planners.optimization.convex import Caps, ChainSolver, nominal_along
from planners.optimization.convex.last_segment import last_segment

_SOLVER = ChainSolver(caps=Caps(rows=4000, iterations=2000), enough=0.0)
_GRAINS = ((6.0, 3), (5.0, 5), (5.5, 8), (4.5, 8), (11.0, 8))
"""Stride [m] of nominal segments and parts of each, tried until a chain is certified."""


def convex_fit(points: Array, field: Field, vehicle: transition.State) -> Array | None:
    """Certified segments (n, 4, 2) that are about as short as the route's homotopy class allows.

    Args:
        points: (m, 2) of the route from the vehicle to the goal, close to each other [m].
        field: of the paper's scale, see `planners.rescaling`.
        vehicle: where the first segment begins.
    """
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length < field.limits.shortest:
        return last_segment(field, vehicle)
    for stride, parts in _GRAINS:
        nominal = nominal_along(points, length, vehicle, field, stride)
        found, _ = _SOLVER.solve(field, vehicle, nominal, parts)
        if found is not None:
            return found.control
    return None
