"""Vehicles by name: the shipped ones, or a JSON file."""

from __future__ import annotations

from pathlib import Path

from ferguson_gym.runtime.arrays import truncate_repr
from ferguson_gym.runtime.suggestions import did_you_mean
from ferguson_gym.vehicles.vehicle import Vehicle, from_json

VEHICLES = {
    vehicle.name: vehicle
    for vehicle in (
        Vehicle(
            name="fixed-wing",
            min_speed=6.0,
            max_speed=15.0,
            max_roll=45.0,
            max_path_acceleration=4.0,
        ),
        # the paper's example: 60 degrees, which allow 7.1 m/s in a turn of 3 m. Such a turn has a
        # load factor of 2, so that 7.1 m/s needs a least speed of at most 7.1 / sqrt(2) = 5.05 m/s
        # in level flight. The paper gives no more: the greatest speed is twice that of the
        # turn, and the acceleration that of fixed-wing
        Vehicle(
            name="paper",
            min_speed=5.0,
            max_speed=14.0,
            max_roll=60.0,
            max_path_acceleration=4.0,
        ),
        Vehicle(name="multirotor", max_speed=15.0, max_acceleration=8.0),
    )
}
"""The shipped vehicles by name."""
_PATH = 300
"""Characters of a path that an error shows."""


def get_vehicle(name: str) -> Vehicle:
    """The vehicle of a name, or of the JSON file at a path.

    Raises:
        ValueError: an unknown name, no such file, or as `ferguson_gym.vehicles.vehicle.from_json`.
        OSError: the file cannot be read.

    Example:
        >>> get_vehicle("fixed-wing").max_speed
        15.0
    """
    if name in VEHICLES:
        return VEHICLES[name]
    path = Path(name)
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long for a file, or with a null character
        found = False
    if found:
        return from_json(path)
    if path.suffix == ".json":
        raise ValueError(f"no such vehicle file: {truncate_repr(name, _PATH)}")
    raise ValueError(
        f"unknown vehicle {truncate_repr(name)}{did_you_mean(name, VEHICLES)}; vehicles are "
        f"{', '.join(VEHICLES)}, or the path of a JSON file"
    )
