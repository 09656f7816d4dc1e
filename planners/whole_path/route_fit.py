"""Fitting of Ferguson chains to a route: knots on it, then all segments optimised together.

The route only determines on which side obstacles are passed: the chain is the shortest that the
optimiser finds nearby. So planners are compared by the homotopy class that they choose, not by how
smooth their routes are.
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Limits, transition
from planners.optimization import MultiStart, along_route, offset_guesses
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.window import SIDE_OFFSET, SMOOTH, final_window

SPACINGS = (11.0, 9.0, 13.0, 7.0, 5.0)
"""Segment lengths of initial guesses [m], tried in turn until one leads to a chain."""
SOLVER = MultiStart(search=ElasticSqp(iterations=200), sidesteps=())


def fit(points: Array, field: Field, vehicle: transition.State, limits: Limits) -> Array | None:
    """Fit a chain (n, 4, 2) to a route: the shortest found, certified feasible; None without one.

    It starts with the vehicle's position and derivative and ends on the goal, as do the route's
    points (m, 2) [m].
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
    # the number of segments must depend on the fitted path, not on the corners of the route
    again = _fit(path.points(), field, vehicle, limits)
    return chain if again is None else again


def _fit(points: Array, field: Field, vehicle: transition.State, limits: Limits) -> Array | None:
    """Fit a chain with about as many segments as the length of the route needs."""
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
        # a straight guess that is too short gives the optimiser no direction in which to lengthen
        # it
        for guess in (on_route, *offset_guesses(on_route, SIDE_OFFSET)):
            (end,) = SOLVER.solve(window, [guess])
            if end.feasible:
                return end.control
    return None
