"""The last segment from nearer to the goal than the shortest segment: a detour, not a convex one.

A segment has a minimum length, so that from such a place it has to bend. A fixed number of segments
that end on the goal in different directions and at different speeds are certified, and the shortest
feasible one is flown.
"""

from __future__ import annotations

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, is_feasible, transition
from planners.optimization.certification import target_tolerance

_ANGLES = np.deg2rad(np.linspace(-165.0, 165.0, 23))
"""Directions at the goal, from that of the straight line there [rad]."""
_SPEEDS = np.linspace(1.0, 16.0, 31)
"""Derivatives at the goal [m per unit t]."""


def last_segment(field: Field, vehicle: transition.State) -> Array | None:
    """The shortest feasible segment (1, 4, 2) among the candidates that end on the goal, if any."""
    away = field.goal - vehicle.position
    straight = complex(away[0], away[1]) / max(float(np.linalg.norm(away)), 1e-12)
    slopes = (straight * np.exp(1j * _ANGLES)[:, None] * _SPEEDS).ravel()
    control = np.empty((len(slopes), 4, 2))
    control[:, 0], control[:, 1], control[:, 2] = vehicle.position, field.goal, vehicle.derivative
    control[:, 3] = np.stack([slopes.real, slopes.imag], axis=1)
    lengths = length(control)
    limits = field.limits
    fit = np.flatnonzero((lengths >= limits.shortest) & (lengths <= limits.longest))
    for k in fit[np.argsort(lengths[fit], kind="stable")].tolist():
        if is_feasible(control[k], field, target_tolerance(field)):
            return control[k : k + 1]
    return None
