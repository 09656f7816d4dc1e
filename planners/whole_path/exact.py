"""The exact shortest path as a route."""

from __future__ import annotations

import time
from dataclasses import dataclass

from ferguson_gym.shortest_paths.exact import path_from
from ferguson_gym.world import Field, transition
from planners.interface import Route

SPACING = 0.25
"""Distance between points on a route [m]."""


@dataclass(frozen=True, slots=True)
class ShortestPathRouter:
    """Routes that are the field's exact shortest paths."""

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Find the shortest path from the vehicle to the goal; the seed has no effect.

        Raises:
            TypeError: a field that is not planar.
        """
        began = time.perf_counter()
        path = path_from(field, vehicle.position)
        if path is None:
            return None
        found = time.perf_counter() - began, path.length
        return Route(points=path.points(SPACING), length=path.length, progress=[found])
