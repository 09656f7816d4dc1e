"""How sharply a path turns: its bending energy, and the speed at which an aircraft can fly it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad

from ferguson_gym.curves.clearance import least_speed
from ferguson_gym.curves.splines import as_control, curvature, derivative, max_curvature
from ferguson_gym.runtime.arrays import Array

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""
PAPER_ROLL = math.radians(60.0)
"""Roll angle of the paper's example."""


def bending_energy(control: ArrayLike) -> Array:
    """Integral of squared curvature over arc length [1/m]: (*batch,) of segments (*batch, 4, D).

    Adaptive quadrature to a relative error of about 1e-9, more where a segment nearly has a cusp.
    The result is infinite for a segment with a cusp. A circular arc of radius R and angle a has the
    energy a / R.
    """
    control = as_control(control)
    segments = control.reshape(-1, *control.shape[-2:])
    energies = np.array([_bending_energy(segment) for segment in segments])
    return energies.reshape(control.shape[:-2])


def _bending_energy(control: Array) -> float:
    if np.isinf(max_curvature(control)):
        return math.inf

    def density(t: float) -> float:
        speed = np.linalg.norm(derivative(control, [t])[0])
        return float(curvature(control, [t])[0] ** 2 * speed)

    # near the minimum of |X'| the curvature can have a narrow peak: the quadrature is split there
    slowest = float(least_speed(control)[1])
    # full output instead of warnings where a segment nearly has a cusp
    energy, *_ = quad(
        density, 0.0, 1.0, points=[slowest], epsabs=1e-12, epsrel=1e-9, limit=200, full_output=1
    )
    return float(energy)


def fastest_turn(radius: float, roll: float = PAPER_ROLL) -> float:
    """Greatest speed [m/s] of a coordinated, level turn: infinite on a straight line.

    Args:
        radius: of the turn [m].
        roll: greatest roll angle [rad].

    Raises:
        ValueError: a negative radius, or a roll angle not between level and a quarter turn.

    Reference:
        The paper, equation (1), solved for the speed.

    Example:
        >>> round(fastest_turn(20.0), 1)  # a radius of 20 m, 60 degrees of roll
        18.4
    """
    if not radius >= 0.0:
        raise ValueError(f"a turn radius is at least 0 m, got {radius}")
    _check_roll(roll)
    return math.sqrt(radius * GRAVITY * math.tan(roll))


def tightest_turn(speed: float, roll: float = PAPER_ROLL) -> float:
    """Least radius [m] of a coordinated, level turn at a speed [m/s]: inverts `fastest_turn`.

    Raises:
        ValueError: a negative speed, or a roll angle not between level and a quarter turn.
    """
    if not speed >= 0.0:
        raise ValueError(f"a speed is at least 0 m/s, got {speed}")
    _check_roll(roll)
    return speed * speed / (GRAVITY * math.tan(roll))


def _check_roll(roll: float) -> None:
    if not 0.0 < roll < math.pi / 2:
        raise ValueError(f"a roll angle lies between 0 and pi/2, got {roll}")
