"""Homotopy classes ranked by the time that a vehicle takes through them.

The fastest flight often takes another way round than the shortest one: wide turns are flown faster.
The shortest path of a class turns as sharply as its obstacles do; smoothed by a Gaussian it turns
about as wide as a fast flight through the same class, and a forward and a backward pass over it
predict the time. The prediction is no bound, since a smoothed path may cut into obstacles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.homotopy_classes import best_classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.vehicles.bound import least_seconds
from ferguson_gym.vehicles.speed_profile import seconds_at_any_speed
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.world.field import Field

WIDTHS = (1.0, 4.0)
"""Standard deviations of the Gaussian along the path, in units of the field's limits."""
_SPACING = 0.25
"""Distance of the points that are smoothed, in the same units."""
_REACH = 4.0
"""The Gaussian is cut off beyond so many standard deviations."""
_MOST = 20_000
"""Upper limit of points on a path."""
OPTIMISM = 0.03
"""Relative amount by which predicted times are taken to be too short where classes are left out."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RankedClass:
    """A homotopy class of paths from start to goal, and how fast it may be flown."""

    path: ShortestPath
    """Its shortest path."""
    seconds: float
    """Predicted time [s]."""
    bound: float
    """Time that no flight through the class beats [s]."""


def ranked_classes(
    field: Field, vehicle: Vehicle, k: int, start_speed: float | None = None
) -> list[RankedClass]:
    """The k shortest homotopy classes of a field, the one predicted to be fastest first.

    Classes whose bound is above the best predicted time by more than `OPTIMISM` are left out.

    Args:
        field: in the plane.
        vehicle: whose limits hold, in still air.
        k: number of classes.
        start_speed: [m/s]; None: that of the vehicle.

    Returns:
        At most k classes; an empty list if there is no path.

    Raises:
        TypeError: a field that is not planar.
        ValueError: k below 1, or a start speed outside the vehicle's.
    """
    vehicle.check_start_speed(start_speed)
    ranked, best = list[RankedClass](), math.inf
    for path in best_classes(field, field.start, k):  # the shortest first
        bound = least_seconds(path.length, vehicle, start_speed)
        if bound > (1.0 + OPTIMISM) * best:
            break
        unit, spots = field.limits.unit, _points(path, field)
        times = [
            seconds_at_any_speed(*_smoothed(spots, width * unit), vehicle, start_speed)
            for width in WIDTHS
        ]
        ranked.append(RankedClass(path=path, seconds=max(bound, min(times)), bound=bound))
        best = min(best, ranked[-1].seconds)
    kept = [one for one in ranked if one.bound <= (1.0 + OPTIMISM) * best]
    return sorted(kept, key=lambda one: one.seconds)


def _points(path: ShortestPath, field: Field) -> tuple[Array, float, Array]:
    """Points at even distances along a path, the distance, and the direction of departure."""
    spacing = max(_SPACING * field.limits.unit, path.length / _MOST)
    number = max(2, math.ceil(path.length / spacing))
    spots = path.at(np.linspace(0.0, path.length, number + 1))
    ahead = field.departure / np.linalg.norm(field.departure)
    return spots, path.length / number, ahead


def _smoothed(points: tuple[Array, float, Array], width: float) -> tuple[Array, Array]:
    """Lengths and curvatures of the pieces of a smoothed path.

    Args:
        points: as of `_points`.
        width: standard deviation of the Gaussian along the path [m].
    """
    spots, spacing, ahead = points
    reach = max(1, math.ceil(_REACH * width / spacing))
    offsets = np.arange(-reach, reach + 1) * spacing
    weights = np.exp(-0.5 * (offsets / width) ** 2)
    weights /= weights.sum()
    # straight on before the start, in the direction of departure, and beyond the goal
    beyond = spots[-1] - spots[-2]
    run_up = spots[0] + offsets[:reach, None] * ahead
    run_out = spots[-1] + np.arange(1, reach + 1)[:, None] * beyond
    extended = np.concatenate([run_up, spots, run_out])
    smooth = np.stack([np.convolve(axis, weights, "valid") for axis in extended.T], axis=1)
    edges = np.diff(smooth, axis=0)
    steps = np.maximum(np.hypot(edges[:, 0], edges[:, 1]), 1e-9 * spacing)
    bends = _bends(edges, steps)
    # a smoothed path cuts corners, but no flight is shorter than the class
    return steps * max(1.0, spacing * len(steps) / steps.sum()), bends


def _bends(edges: Array, steps: Array) -> Array:
    """Curvatures (n,) on the edges of a polygon (n, 2) with lengths (n,)."""
    cross = edges[:-1, 0] * edges[1:, 1] - edges[:-1, 1] * edges[1:, 0]
    turns = np.abs(np.arctan2(cross, (edges[:-1] * edges[1:]).sum(axis=1)))
    bends = np.concatenate([[0.0], 2.0 * turns / (steps[:-1] + steps[1:]), [0.0]])
    return np.asarray(np.maximum(bends[:-1], bends[1:]))
