"""Optimisation of all segments of a flight together, to measure what a horizon loses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from planners.optimization.window import SMOOTH, final_window
from planners.whole_path.route_fit import SOLVER


def polish(control: ArrayLike, field: Field, limits: Limits = PAPER_LIMITS) -> Array:
    """Shorten a flight: the shortest chain (n, 4, 2) found near it, with as many segments.

    The result is certified feasible; it is the flight itself if no shorter chain is found.

    Args:
        control: segments (n, 4, 2) of a feasible flight that ends on the goal.
        field: where it is flown.
        limits: bounds on a segment.

    Raises:
        ValueError: a control array of another shape, or a flight that does not end on the goal.
    """
    chain = as_control(control)
    if chain.ndim != 3 or chain.shape[-1] != 2 or len(chain) == 0:
        raise ValueError(f"a flight has shape (n, 4, 2) with n >= 1, got {chain.shape}")
    if not np.array_equal(chain[-1, 1], field.goal):
        raise ValueError(f"the flight ends at {chain[-1, 1].tolist()}, not on the goal")
    vehicle = transition.State(chain[0, 0], chain[0, 2])
    window = final_window(field, vehicle, limits, SMOOTH, len(chain))
    (end,) = SOLVER.solve(window, [chain])
    if end.feasible and length(end.control).sum() < length(chain).sum():
        return end.control
    return chain
