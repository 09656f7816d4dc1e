"""Segments flown in a time: velocity, acceleration, and certified limits along the whole segment.

A segment with derivative X' that is flown in the duration T has the velocity X' / T and the
acceleration X'' / T^2. In a constant wind w, the velocity relative to the air is X' / T - w: that
of the segment with end X(1) - w T and derivatives X' - w T, so that wind changes no formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.certified_kernels import least_speed
from ferguson_gym.curves.splines import as_control, derivative
from ferguson_gym.runtime.arrays import Array, finite, real
from ferguson_gym.vehicles.rate_kernels import greatest_rates
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_outcome import FAILURES, VehicleOutcome

TOLERANCE = 1e-5
"""Relative amount by which every limit of a vehicle may be broken; planners aim for a tenth."""
_LEAST = 1e-60
"""Least duration [s]; accelerations of the greatest segments are finite then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Certified extremes along whole timed segments; every array has their batch shape.

    Each is proved for the whole curve, and greatest values exceed the true ones by at most about
    1e-8 (relative), those of accelerations across and along the path also by 1e-8 times the
    greatest acceleration. The least speed is less than the true one by at most 1e-9 times the
    greatest Bézier point of the velocity. Where the velocity nearly vanishes, accelerations
    across and along the path are bounded by that in total.
    """

    least_speed: Array
    """[m/s], a lower bound."""
    greatest_speed: Array
    """[m/s]."""
    across: Array
    """Greatest acceleration across the path [m/s^2], g tan(roll) of a coordinated turn."""
    along: Array
    """Greatest acceleration along the path, forwards or backwards [m/s^2]."""
    acceleration: Array
    """Greatest acceleration in total [m/s^2]."""

    def ratios(self, vehicle: Vehicle) -> Array:
        """Each extreme as a part of its limit: (*batch, 5), at most 1 where the limit is kept.

        Tests come in the order in which the first failure is reported: least speed (the limit as a
        part of the extreme), greatest speed, roll (as tan(roll) / tan(max_roll)), acceleration
        along the path and in total. What has no limit has the ratio 0.
        """
        slow = np.zeros(self.least_speed.shape)
        if vehicle.min_speed > 0.0:
            with np.errstate(divide="ignore"):
                slow = vehicle.min_speed / self.least_speed
        found = (self.greatest_speed, self.across, self.along, self.acceleration)
        along, total = vehicle.max_path_acceleration, vehicle.max_acceleration
        limits = (
            vehicle.max_speed,
            vehicle.max_lateral,
            np.inf if along is None else along,
            np.inf if total is None else total,
        )
        parts = [value / limit for value, limit in zip(found, limits, strict=True)]
        return np.stack([slow, *parts], axis=-1)

    def margin(self, vehicle: Vehicle) -> Array:
        """What is left of the limit that is nearest: (*batch,), 1 - the greatest ratio.

        It is negative where a limit is broken.
        """
        return np.asarray(1.0 - self.ratios(vehicle).max(axis=-1))

    def outcome(self, vehicle: Vehicle, tolerance: float = TOLERANCE) -> VehicleOutcome:
        """WITHIN_LIMITS if all of the segments keep the limits, otherwise their first failure.

        Args:
            vehicle: with the limits.
            tolerance: relative amount by which each may be broken.
        """
        # `not ... <=`, so that NaN fails every test
        broken = ~(self.ratios(vehicle).reshape(-1, len(FAILURES)) <= 1.0 + tolerance)
        segments = broken[broken.any(axis=1)]
        return (
            FAILURES[int(segments[0].argmax())] if len(segments) else VehicleOutcome.WITHIN_LIMITS
        )


def velocity(control: ArrayLike, duration: ArrayLike, t: ArrayLike) -> Array:
    """Velocity over the ground at parameters: (*batch, n, 2) [m/s]; errors as `timed`."""
    control, duration = timed(control, duration)
    return np.asarray(derivative(control, np.atleast_1d(t)) / duration[..., None, None])


def acceleration(control: ArrayLike, duration: ArrayLike, t: ArrayLike) -> Array:
    """Acceleration at parameters: (*batch, n, 2) [m/s^2]; errors as `timed`."""
    control, duration = timed(control, duration)
    return np.asarray(derivative(control, np.atleast_1d(t), 2) / duration[..., None, None] ** 2)


def timed(control: ArrayLike, duration: ArrayLike) -> tuple[Array, Array]:
    """Checked planar segments (*batch, 4, 2) and their durations (*batch,) [s].

    Raises:
        ValueError: segments that are not planar or not finite, durations that are not positive and
            finite, or that have another shape and cannot be broadcast to that of the batch.
    """
    control = as_control(control)
    if control.shape[-1] != 2:
        raise ValueError(
            f"timed segments are planar, got segments in {control.shape[-1]} dimensions"
        )
    given = real("durations", duration)
    given = finite("durations", given, (None,) * given.ndim)
    if given.size and not given.min() >= _LEAST:
        raise ValueError(f"a duration must be above 0 s, got {given.min():g} s")
    try:
        return control, np.broadcast_to(given, control.shape[:-2])
    except ValueError:
        raise ValueError(
            f"durations of shape {given.shape} do not belong to segments of shape "
            f"{control.shape[:-2]}; give one for each segment, or one for all"
        ) from None


def relative_to_air(control: Array, duration: Array, wind: Array) -> Array:
    """The control array (*batch, 4, 2) of segments in coordinates that move with the wind."""
    drift = duration[..., None] * wind
    zero = np.zeros_like(drift)
    return control - np.stack([zero, drift, drift, drift], axis=-2)


def rates(control: ArrayLike, duration: ArrayLike, wind: ArrayLike | None = None) -> Rates:
    """Certify speeds and accelerations of timed segments along their whole length.

    Args:
        control: (*batch, 4, 2) segments.
        duration: (*batch,) [s], or one for all.
        wind: (2,) constant [m/s], see `Vehicle.check_wind`; None: still air.

    Raises:
        ValueError: as `timed`, or a wind of another shape or not finite.

    Example:
        >>> from ferguson_gym.vehicles.vehicle_names import get_vehicle
        >>> found = rates([[0, 0], [9, 3], [9, 0], [9, 6]], 0.7)
        >>> found.outcome(get_vehicle("fixed-wing")).sentence
        'flies faster than the vehicle can'
    """
    control, duration = timed(control, duration)
    if wind is not None:
        control = relative_to_air(control, duration, finite("wind", wind, (2,)))
    flat = np.ascontiguousarray(control.reshape(-1, 4, 2))
    seconds = duration.reshape(-1)
    slowest, _ = least_speed(flat, (0, 1))
    found = greatest_rates(flat)
    found[:, 0] /= seconds
    found[:, 1:] /= (seconds * seconds)[:, None]
    fastest, across, along, total = (column.reshape(duration.shape) for column in found.T)
    return Rates(
        least_speed=(slowest / seconds).reshape(duration.shape),
        greatest_speed=fastest,
        across=across,
        along=along,
        acceleration=total,
    )
