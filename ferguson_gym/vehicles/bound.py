"""A lower bound of the time of every flight through a field."""

from __future__ import annotations

import math

from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.world.field import Field


def least_seconds(metres: float, vehicle: Vehicle, start_speed: float | None = None) -> float:
    """Time for a distance straight ahead [s].

    The vehicle accelerates as hard as it can, from the speed at the start to its greatest speed.

    Args:
        metres: the distance.
        vehicle: whose limits hold, in still air.
        start_speed: [m/s]; None: that of the vehicle.

    Raises:
        ValueError: a negative distance, or a start speed outside the vehicle's.

    Example:
        >>> from ferguson_gym.vehicles.vehicle_names import get_vehicle
        >>> round(least_seconds(144.338, get_vehicle("fixed-wing")), 2)
        10.3
    """
    start = vehicle.check_start_speed(start_speed)
    top, most = vehicle.max_speed, vehicle.max_longitudinal
    if not 0.0 <= metres < math.inf:
        raise ValueError(f"a distance is at least 0 m and finite, got {metres}")
    if math.isinf(most):
        return metres / top
    run_up = (top - start) * (top + start) / (2.0 * most)
    if metres >= run_up:
        return (top - start) / most + (metres - run_up) / top
    # 2 d / (v + w) with the speed w at the end, which does not cancel
    return (
        2.0 * metres / (start + math.sqrt(start * start + 2.0 * most * metres)) if metres else 0.0
    )


def fastest_bound(field: Field, vehicle: Vehicle, start_speed: float | None = None) -> float | None:
    """Time that no flight from start to goal beats [s], in still air; None without a path.

    No flight is shorter than the exact length, and none covers it faster than straight ahead
    (`least_seconds`). The direction at the start, the least speed and turns are left out, since
    they can only lengthen a flight. A flight may use the tolerances of obstacles (1e-5 m) and of
    limits (1e-5, relative), and then be faster by about as much. None, too, for fields in other
    spaces than the plane, whose exact length is unknown.

    Raises:
        ValueError: a start speed outside the vehicle's.

    Example:
        >>> from ferguson_gym.vehicles.vehicle_names import get_vehicle
        >>> from ferguson_gym.world.field_names import get_field
        >>> round(fastest_bound(get_field("paper:2"), get_vehicle("multirotor")), 2)
        10.04
    """
    metres = exact_length(field)
    return None if metres is None else least_seconds(metres, vehicle, start_speed)
