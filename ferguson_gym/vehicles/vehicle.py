"""Limits of a vehicle: speed, roll of a coordinated turn, and acceleration; and their JSON form."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.turning import GRAVITY
from ferguson_gym.runtime.arrays import Array, finite, truncate_repr
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.runtime.json_files import read_json
from ferguson_gym.runtime.suggestions import did_you_mean

START_SHARE = 1.0 / 3.0
"""Flights start at this part of the greatest speed, or at the least speed if that is higher."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """Limits that hold along the whole flight, for the velocity relative to the air.

    Level flight without side slip is assumed: turns are coordinated, so that a limit of roll is one
    of the acceleration across the path, g tan(roll).

    Raises:
        ValueError: limits that contradict each other, or that are not positive and finite.

    Reference:
        The paper, equation (1), for the roll.

    Example:
        >>> glider = Vehicle(min_speed=6, max_speed=15, max_roll=45)
        >>> glider.start_speed, round(glider.turn_radius(15.0), 1)
        (6.0, 22.9)
    """

    name: str = "vehicle"
    """Name in files and reports; a file's is its stem."""
    max_speed: float
    """Greatest speed [m/s]."""
    min_speed: float = 0.0
    """Least speed [m/s]; 0 if the vehicle can hover."""
    max_roll: float | None = None
    """Greatest roll angle [degrees], between 0 and 90; None if turns have no limit of their own."""
    max_path_acceleration: float | None = None
    """Greatest acceleration along the path, forwards or backwards [m/s^2]; None without limit."""
    max_acceleration: float | None = None
    """Greatest acceleration in total [m/s^2]; None without limit."""

    def __post_init__(self) -> None:
        for limit in LIMITS:
            value = getattr(self, limit)
            if value is None and limit in _OPTIONAL:
                continue
            if isinstance(value, (bool, np.bool_)):  # would count as 1 or 0
                raise ValueError(f"{limit} of a vehicle must be a number, got {value}")
            number = float(finite(f"{limit} of a vehicle", value, ()))
            object.__setattr__(self, limit, number)
            if limit != "min_speed" and not number > 0.0:
                way_out = "; omit it for no limit" if limit in _OPTIONAL else ""
                raise ValueError(f"{limit} of a vehicle must be above 0, got {number:g}{way_out}")
        if not 0.0 <= self.min_speed < self.max_speed:
            raise ValueError(
                f"need 0 <= min_speed < max_speed, got {self.min_speed:g} m/s and "
                f"{self.max_speed:g} m/s"
            )
        if self.max_roll is not None and not self.max_roll < 90.0:
            raise ValueError(
                f"max_roll of a vehicle is an angle below 90 degrees, got {self.max_roll:g}; "
                "omit it for no limit"
            )
        along, total = self.max_path_acceleration, self.max_acceleration
        if along is not None and total is not None and along > total:
            raise ValueError(
                f"max_path_acceleration of {along:g} m/s^2 exceeds max_acceleration of "
                f"{total:g} m/s^2, of which it is a part; omit one of them"
            )

    @property
    def start_speed(self) -> float:
        """Speed at which flights start by default [m/s].

        It is the greater one of the least speed and a third of the greatest speed.
        """
        return max(self.min_speed, START_SHARE * self.max_speed)

    @property
    def max_lateral(self) -> float:
        """Greatest acceleration across the path that the roll allows [m/s^2]; may be infinite."""
        if self.max_roll is None:
            return math.inf
        return GRAVITY * math.tan(math.radians(self.max_roll))

    @property
    def max_longitudinal(self) -> float:
        """Greatest acceleration along the path that both limits allow [m/s^2]; may be infinite."""
        limits = (self.max_path_acceleration, self.max_acceleration)
        return min((limit for limit in limits if limit is not None), default=math.inf)

    def turn_radius(self, speed: float) -> float:
        """Least radius [m] of a turn at a constant speed [m/s]; 0 if nothing limits turns."""
        total = math.inf if self.max_acceleration is None else self.max_acceleration
        return speed * speed / min(self.max_lateral, total)

    def check_wind(self, wind: ArrayLike | None) -> Array:
        """A constant wind (2,) [m/s], zero if None is given.

        Raises:
            ValueError: another shape, not finite, or at least as fast as the vehicle.
        """
        if wind is None:
            return np.zeros(2)
        checked = finite("wind", wind, (2,))
        speed = float(np.linalg.norm(checked))
        if not speed < self.max_speed:
            raise ValueError(
                f"a wind of {speed:g} m/s is too fast for {self.name}, which flies at most "
                f"{self.max_speed:g} m/s"
            )
        return checked

    def check_start_speed(self, speed: float | None) -> float:
        """A speed at the start [m/s], `start_speed` if None is given.

        Raises:
            ValueError: outside the vehicle's speeds, or not finite.
        """
        if speed is None:
            return self.start_speed
        checked = float(finite("a start speed", speed, ()))
        if not self.min_speed <= checked <= self.max_speed:
            raise ValueError(
                f"a start speed of {checked:g} m/s is outside the speeds of {self.name}, "
                f"{self.min_speed:g} to {self.max_speed:g} m/s"
            )
        return checked


LIMITS = tuple(field.name for field in dataclasses.fields(Vehicle) if field.name != "name")
"""Names of a vehicle's limits, in JSON files too."""
_OPTIONAL = ("max_roll", "max_path_acceleration", "max_acceleration")


def from_json(path: str | os.PathLike[str]) -> Vehicle:
    """Read a vehicle from a JSON file; the file's stem is its name.

    Keys are those of `LIMITS`, of which only `max_speed` is required; null means no limit.

    Raises:
        ValueError: not JSON, an unknown key, or values that `Vehicle` refuses; the message names
            the file.
        OSError: the file cannot be read.
    """
    path = Path(path)
    try:
        data = read_json(path)
        if isinstance(data, dict):
            _check_names(data)
        if not isinstance(data, dict) or data.get("max_speed") is None:
            raise ValueError("a vehicle is a JSON object with max_speed, in m/s")
        given: dict[str, Any] = {key: value for key, value in data.items() if value is not None}
        return Vehicle(name=path.stem, **given)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _check_names(given: Iterable[str]) -> None:
    for name in given:
        if name not in LIMITS:
            near = did_you_mean(name, LIMITS)
            raise ValueError(
                f"unknown limit {truncate_repr(name)} of a vehicle{near}; "
                f"limits are {', '.join(LIMITS)}"
            )


def to_json(vehicle: Vehicle, path: str | os.PathLike[str]) -> None:
    """Write a vehicle's limits as JSON; reading them again gives the same numbers, bit for bit."""
    data = {limit: getattr(vehicle, limit) for limit in LIMITS}
    with atomic_write(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
