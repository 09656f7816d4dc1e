"""Ferguson chains along a route: knots on it, then all segments optimised together.

The route gives the way past the obstacles, no more: the chain is the shortest that the optimiser
finds near it, so that planners are compared by the way they chose and not by their corners.
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from planners.optimization.initial_guesses import along_route
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.sqp.multi_start import MultiStart, offset_guesses
from planners.optimization.window import SIDE_OFFSET, SMOOTH, final_window

SPACINGS = (11.0, 9.0, 13.0, 7.0, 5.0)
"""Length of segments at first [m]; tried one after the other until one leads to a chain."""
SOLVER = MultiStart(search=ElasticSqp(iterations=200), sidesteps=())


def fit(points: Array, field: Field, vehicle: transition.State, limits: Limits) -> Array | None:
    """The shortest chain (n, 4, 2) found along a route, certified feasible; None without one.

    It leaves the vehicle's position with its derivative and ends on the goal.

    Args:
        points: (m, 2) of the route, from the vehicle to the goal [m].
        field: what it leads through.
        vehicle: where the chain starts.
        limits: what a segment may be.
    """
    left = limits.segments - vehicle.segments
    if left < 1:
        return None
    chain = _fit(points, field, vehicle, limits)
    if chain is None:
        return None
    path = Path(chain)
    if len(chain) == min(math.ceil(path.length / SPACINGS[0]), left):
        return chain
    # corners of a route must not buy more segments than the way itself calls for
    again = _fit(path.points(), field, vehicle, limits)
    return chain if again is None else again


def _fit(points: Array, field: Field, vehicle: transition.State, limits: Limits) -> Array | None:
    """With as many segments as the length of the points calls for, if that leads to a chain."""
    whole = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    tried: set[int] = set()
    for spacing in SPACINGS:
        left = limits.segments - vehicle.segments
        segments = min(max(1, math.ceil(whole / spacing)), left)
        if segments in tried:
            continue
        tried.add(segments)
        window = final_window(field, vehicle, limits, SMOOTH, segments)
        on_route = along_route(vehicle, points, segments, whole)
        # a guess on a straight line cannot choose a side to be long enough on
        for guess in (on_route, *offset_guesses(on_route, SIDE_OFFSET)):
            (end,) = SOLVER.solve(window, [guess])
            if end.feasible:
                return end.control
    return None
