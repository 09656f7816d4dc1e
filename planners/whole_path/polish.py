"""Optimisation of all segments of a flight together, to measure the cost of the limited horizon."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import as_control
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from ferguson_gym.world.similarity import similarity
from planners.optimization.window import SMOOTH, final_window
from planners.whole_path.route_fit import SOLVER


def polish(control: ArrayLike, field: Field) -> Array:
    """Shorten a feasible flight (n, 4, 2) that ends on the goal, keeping its number of segments.

    The result (n, 4, 2) is certified feasible; the input is returned if no shorter chain is found
    near it.

    Raises:
        ValueError: a control array of another shape, or a flight that does not end on the goal.
    """
    chain = as_control(control)
    if chain.ndim != 3 or chain.shape[-1] != 2 or len(chain) == 0:
        raise ValueError(f"a flight has shape (n, 4, 2) with n >= 1, got {chain.shape}")
    if not np.array_equal(chain[-1, 1], field.goal):
        raise ValueError(f"the flight ends at {chain[-1, 1].tolist()}, not on the goal")
    if (seen := similarity(field)) is not None:
        return seen.control_back(polish(seen.control(chain), seen.image))
    vehicle = transition.State(chain[0, 0], chain[0, 2])
    window = final_window(field, vehicle, SMOOTH, len(chain))
    (end,) = SOLVER.solve(window, [chain])
    if end.feasible and length(end.control).sum() < length(chain).sum():
        return end.control
    return chain
