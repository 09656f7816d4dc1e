"""Durations for a given chain of segments.

Neighbours with the same direction at their joint have the same velocity there if their durations
are in the ratio of their derivatives: |X'(1)| / T = |Y'(0)| / U. So all durations of a chain follow
from one of them. In a C1 chain the derivatives are equal, and so are all durations; other ratios
of durations need other derivatives, and so another path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.vehicles.chain import as_chain
from ferguson_gym.vehicles.timed_segments import rates
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_outcome import VehicleOutcome


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Retiming:
    """Durations of a chain of segments."""

    durations: Array
    """(n,) [s]."""
    outcome: VehicleOutcome
    """WITHIN_LIMITS, or the limit that these durations break."""

    @property
    def seconds(self) -> float:
        """Duration of the whole flight [s]."""
        return float(self.durations.sum())


def duration_ratios(control: ArrayLike) -> Array:
    """Durations (n,) that make the velocity of a chain continuous, as multiples of the first.

    Args:
        control: (n, 4, D) segments that join in points and directions.

    Raises:
        ValueError: as `ferguson_gym.vehicles.chain.as_chain`, or a derivative of zero at a joint.

    Example:
        >>> slow_then_fast = [[[0, 0], [4, 0], [4, 0], [4, 0]], [[4, 0], [12, 0], [8, 0], [8, 0]]]
        >>> duration_ratios(slow_then_fast).tolist()
        [1.0, 2.0]
    """
    control = as_chain(control)
    arrive, leave = control[:-1, 3], control[1:, 2]
    before, after = np.linalg.norm(arrive, axis=1), np.linalg.norm(leave, axis=1)
    if not (before.all() and after.all()):
        raise ValueError("a derivative at a joint is zero, so that no duration follows from it")
    return np.cumprod(np.concatenate([[1.0], after / before]))


def shortest_durations(control: ArrayLike, vehicle: Vehicle) -> Retiming:
    """The least durations with which a chain keeps a vehicle's limits, in still air.

    The velocity is continuous, so that all durations are known up to one factor. Limits of the
    greatest speed, roll and accelerations bound the factor from below; the least one is taken.
    Where the vehicle is then below its least speed anywhere, no factor will do. The speed at the
    start follows as well: it is |X'(0)| over the first duration, not `Vehicle.start_speed`.

    Args:
        control: (n, 4, 2) chain, as for `duration_ratios`.
        vehicle: whose limits hold.

    Raises:
        ValueError: as `duration_ratios`, segments that are not planar, or a chain that does not
            move.
    """
    ratios = duration_ratios(control)
    parts = rates(control, ratios).ratios(vehicle)[:, 1:]
    # speeds fall with the factor, accelerations with its square
    factor = max(float(parts[:, 0].max()), float(np.sqrt(parts[:, 1:].max())))
    if not factor > 0.0:
        raise ValueError("a chain that does not move has no durations")
    durations = factor * ratios
    return Retiming(durations=durations, outcome=rates(control, durations).outcome(vehicle))
