"""Routes that leave along the vehicle's heading and turn into another route on a circle."""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.transition import State

_JOIN_RADII = 4.0
"""The route is joined at its first point at least this many radii away, or at its last point."""
_ANGLES = np.linspace(0.0, 2.0 * math.pi, 145)


def turn_in_routes(state: State, points: Array, radius: float) -> list[Array]:
    """Routes that begin with an arc of a radius [m], one to the left, one to the right.

    They then join a route (m, 2). The results (k, 2) are initial guesses: they may collide, and
    have a corner where the tangent from the circle meets the route. A turn that never faces the
    route is left out.
    """
    away = np.linalg.norm(points - state.position, axis=1) >= _JOIN_RADII * radius
    meeting = int(away.argmax()) if away.any() else len(points) - 1
    forward = math.atan2(state.derivative[1], state.derivative[0])
    routes = []
    for side in (1.0, -1.0):
        heading = forward + side * _ANGLES
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        out = side * radius * np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
        arc = state.position + out - out[0]
        offset = points[meeting] - arc
        along = np.sum(offset * ahead, axis=1)
        across = side * (ahead[:, 0] * offset[:, 1] - ahead[:, 1] * offset[:, 0])
        # the heading has turned past the meeting point
        if (facing := (across[:-1] > 0.0) & (across[1:] <= 0.0) & (along[1:] > 0.0)).any():
            count = int(facing.argmax()) + 2
            chord = math.dist(arc[count - 1], points[meeting])
            share = np.linspace(0.0, 1.0, max(2, math.ceil(chord)))[1:-1, None]
            line = arc[count - 1] + share * (points[meeting] - arc[count - 1])
            routes.append(np.concatenate([arc[:count], line, points[meeting:]]))
    return routes
