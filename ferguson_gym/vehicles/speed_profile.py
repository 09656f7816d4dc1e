"""The fastest flight along a given path: a forward and a backward pass over its pieces.

A path is cut into pieces with a length and an upper bound of the curvature each. On every piece,
the square u of the speed changes linearly with the distance, that is, the acceleration along the
path is constant. Roll, greatest speed and acceleration in total limit u on each piece. The forward
pass accelerates as hard as they allow, and the backward pass brakes as hard as they allow. All
limits then hold on all pieces, so that the flight is possible and its time an upper limit of the
least one; finer pieces bring the two together.

Reference:
    Bobrow, Dubowsky & Gibson (1985), Time-optimal control of robotic manipulators along specified
    paths, International Journal of Robotics Research 4(3); Pham & Pham (2018), A new approach to
    time-optimal path parameterization based on reachability analysis, IEEE Transactions on
    Robotics 34(3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import as_control, derivative, evaluate, max_curvature
from ferguson_gym.runtime.arrays import Array, finite, real
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.vehicles.chain import as_chain
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_outcome import VehicleOutcome

ACCURACY = 1e-4
"""Relative change of the time below which pieces are not halved again."""
_COARSEST, _FINEST = 8, 512
"""Least and greatest number of pieces a segment."""
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpeedProfile:
    """Speeds along a path, as fast as the vehicle's limits allow."""

    distance: Array
    """(n + 1,) of the ends of pieces from the start [m]."""
    speed: Array
    """(n + 1,) there [m/s]; between them its square changes linearly with the distance. Without
    meaning where the path cannot be flown."""
    seconds: float
    """Time to the end; infinite if the path cannot be flown."""
    outcome: VehicleOutcome
    """WITHIN_LIMITS, or the limit that makes the path impossible."""
    where: float
    """Distance from the start at which it does [m]; NaN if none does."""


@compiled
def _reach(square: float, step: float, bend: float, along: float, total: float) -> float:
    """Greatest u after a piece.

    Args:
        square: u before it.
        step: length of the piece [m].
        bend: upper bound of its curvature [1/m].
        along: limit of the acceleration along the path; may be infinite.
        total: limit of the acceleration in total; may be infinite.
    """
    reached = square + 2.0 * step * along
    if total < np.inf:
        # (x - u)^2 / (2 h)^2 + (bend x)^2 = total^2
        double = 2.0 * step
        shape = 1.0 + (double * bend) ** 2
        root = max(0.0, total * total * shape - (bend * square) ** 2)
        reached = min(reached, (square + double * math.sqrt(root)) / shape)
    return reached


@compiled
def _passes(
    steps: Array, bends: Array, squares: Array, start: float, along: float, total: float
) -> float:
    """Lower the squares (n + 1,) of the speed to what can be flown; return the time.

    Args:
        steps: (n,) lengths of pieces [m].
        bends: (n,) upper bounds of their curvature [1/m].
        squares: (n + 1,) limits at their ends, by all but accelerations along the path.
        start: square of the speed at the start.
        along: limit of the acceleration along the path; may be infinite.
        total: limit of the acceleration in total; may be infinite.
    """
    number = len(steps)
    squares[0] = min(squares[0], start)
    for i in range(number):
        reached = _reach(squares[i], steps[i], bends[i], along, total)
        squares[i + 1] = min(squares[i + 1], reached)
    for i in range(number - 1, -1, -1):
        reached = _reach(squares[i + 1], steps[i], bends[i], along, total)
        squares[i] = min(squares[i], reached)
    seconds = 0.0
    for i in range(number):
        seconds += 2.0 * steps[i] / (math.sqrt(squares[i]) + math.sqrt(squares[i + 1]))
    return seconds


def profile(
    steps: ArrayLike, bends: ArrayLike, vehicle: Vehicle, start_speed: float | None = None
) -> SpeedProfile:
    """The fastest flight along pieces of a path.

    Args:
        steps: (n,) lengths of pieces [m].
        bends: (n,) upper bounds of their curvature [1/m]; may be infinite.
        vehicle: whose limits hold, in still air.
        start_speed: [m/s]; None: that of the vehicle. The speed at the end is free.

    Raises:
        ValueError: no piece, lengths that are not above 0 and finite, curvatures that are negative
            or NaN or of another number, or a start speed outside the vehicle's.

    Example:
        >>> from ferguson_gym.vehicles.vehicle_names import get_vehicle
        >>> straight = profile([100.0], [0.0], get_vehicle("multirotor"), start_speed=0.0)
        >>> straight.speed.tolist()
        [0.0, 15.0]
    """
    start = vehicle.check_start_speed(start_speed)
    steps, bends, caps = _checked(steps, bends, vehicle)
    along, total = _accelerations(vehicle)
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    squares = np.minimum(np.append(caps, np.inf), np.insert(caps, 0, np.inf))
    steep = VehicleOutcome.TOO_STEEP if vehicle.max_lateral <= total else VehicleOutcome.TOO_HARD
    too_sharp = np.flatnonzero(caps < vehicle.min_speed**2 * (1.0 - _ROUNDING))
    stuck = np.flatnonzero(caps <= 0.0)
    outcome, where = VehicleOutcome.WITHIN_LIMITS, math.nan
    seconds = math.inf
    if len(too_sharp) or len(stuck):
        outcome, where = steep, float(distance[min([*too_sharp[:1], *stuck[:1]])])
    elif squares[0] < start**2 * (1.0 - _ROUNDING):
        outcome, where = steep, 0.0
    else:
        seconds = float(_passes(steps, bends, squares, start**2, along, total))
        if squares[0] < start**2 * (1.0 - _ROUNDING):
            hard = VehicleOutcome.TOO_HARD_ALONG if along <= total else VehicleOutcome.TOO_HARD
            outcome, where, seconds = hard, 0.0, math.inf
    return SpeedProfile(
        distance=distance, speed=np.sqrt(squares), seconds=seconds, outcome=outcome, where=where
    )


def seconds_at_any_speed(
    steps: ArrayLike, bends: ArrayLike, vehicle: Vehicle, start_speed: float | None = None
) -> float:
    """As `profile`, but the vehicle may fly slower than its least speed, and start slower.

    So the time of a path that cannot be flown is finite, and long if it is far from that: a
    measure to rank paths by. It is infinite where a curvature is.
    """
    start = vehicle.check_start_speed(start_speed)
    steps, bends, caps = _checked(steps, bends, vehicle)
    squares = np.minimum(np.append(caps, np.inf), np.insert(caps, 0, np.inf))
    return float(_passes(steps, bends, squares, start**2, *_accelerations(vehicle)))


def _checked(steps: ArrayLike, bends: ArrayLike, vehicle: Vehicle) -> tuple[Array, Array, Array]:
    """Lengths and curvatures of pieces, and the greatest square of the speed on each."""
    steps = finite("lengths of pieces", steps, (None,))
    if not (len(steps) and steps.min() > 0.0):
        raise ValueError("a path consists of at least one piece, and all are longer than 0 m")
    bends = real("curvatures of pieces", bends)
    if bends.shape != steps.shape or not (bends >= 0.0).all():
        raise ValueError(f"need a curvature of at least 0 for each of {len(steps)} pieces")
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        caps = min(vehicle.max_lateral, _accelerations(vehicle)[1]) / bends
    caps[np.isnan(caps)] = np.inf  # nothing limits turns
    return steps, bends, np.minimum(caps, vehicle.max_speed**2)


def _accelerations(vehicle: Vehicle) -> tuple[float, float]:
    """Limits of the acceleration along the path and in total [m/s^2], infinite where none is."""
    along, total = vehicle.max_path_acceleration, vehicle.max_acceleration
    return math.inf if along is None else along, math.inf if total is None else total


def pieces_of(control: ArrayLike, number: int) -> tuple[Array, Array]:
    """Lengths [m] and greatest curvatures [1/m] of pieces of equal parameter, (n * number,) each.

    Args:
        control: (n, 4, D) chain of segments.
        number: of pieces a segment.
    """
    control = as_control(control)
    t = np.arange(number + 1) / number
    points, slopes = evaluate(control, t), derivative(control, t) / number
    pieces = np.stack([points[:, :-1], points[:, 1:], slopes[:, :-1], slopes[:, 1:]], axis=2)
    flat = pieces.reshape(-1, 4, control.shape[-1])
    return length(flat), max_curvature(flat)


def fastest_along(
    control: ArrayLike,
    vehicle: Vehicle,
    start_speed: float | None = None,
    accuracy: float = ACCURACY,
) -> SpeedProfile:
    """The fastest flight along a chain of segments, with speeds that are free along it.

    This is what a pipeline reaches that plans a path first and its speeds then. Pieces are halved
    until the time changes by less than `accuracy` (relative), but to no more than 512 a segment.
    The time converges in first order: finer pieces would save about as much again as the last
    halving did.

    Args:
        control: (n, 4, 2) segments, each beginning where and in the direction in which the one
            before it ends.
        vehicle: whose limits hold, in still air.
        start_speed: [m/s]; None: that of the vehicle. The speed at the end is free.
        accuracy: relative change of the time at the last halving.

    Raises:
        ValueError: as `ferguson_gym.vehicles.chain.as_chain`, segments that are not planar or of
            length zero, an accuracy that is not positive, or as `profile`.
    """
    control = as_chain(control)
    if control.shape[-1] != 2:
        raise ValueError(f"a chain is planar here, got segments in {control.shape[-1]} dimensions")
    if not accuracy > 0.0:
        raise ValueError(f"an accuracy must be above 0, got {accuracy}")
    number = _COARSEST
    best = profile(*pieces_of(control, number), vehicle, start_speed)
    while number < _FINEST:
        number *= 2
        finer = profile(*pieces_of(control, number), vehicle, start_speed)
        done = best.seconds <= (1.0 + accuracy) * finer.seconds
        best = finer
        # finer pieces may leave room for braking from the start, but no turn becomes wider
        if best.where > 0.0 or (best.outcome.success and done):
            break
    return best
