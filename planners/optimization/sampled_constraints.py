"""Sampled constraints of a window, for the reference solvers (SLSQP, IPOPT), with exact gradients.

Rows are feasible where >= 0. Every row belongs to one segment, so that its gradient is that
segment's (4, D) control gradient. A `planners.optimization.nonlinear_program.Problem` has a list of
constraints. The elastic SQP does not use them: its constraints are the contacts of
`planners.optimization.sqp.contacts`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.splines import basis
from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.quadrature import length_gradients, lengths

Indices = NDArray[np.intp]


class Constraint(Protocol):
    """Some rows of a problem's constraints."""

    def values(self, control: GenericArray) -> GenericArray:
        """Rows (m,) [m] for segments (n, 4, D), real or complex; feasible where >= 0."""

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients (m, 4, D), and the segment (m,) each belongs to."""


@dataclass(frozen=True, slots=True, eq=False)
class LengthBounds:
    """Every segment between the shortest and the longest length: 2n rows.

    Reference:
        The paper, section III-C3, with the true length instead of its estimate by chords.
    """

    limits: Limits
    correction: Array
    """(n,) certified length minus quadrature length [m]; nonzero only near cusps."""

    def values(self, control: GenericArray) -> GenericArray:
        """Rows: length - shortest, then longest - length [m]."""
        length = lengths(control) + self.correction
        return np.concatenate([length - self.limits.shortest, self.limits.longest - length])

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients (2n, 4, D), and the segment each belongs to."""
        gradient = length_gradients(control)
        return np.concatenate([gradient, -gradient]), np.tile(np.arange(len(control)), 2)


@dataclass(frozen=True, slots=True, eq=False)
class SampledClearance:
    """Signed distance at n_s points of every segment, from every obstacle.

    Reference:
        The paper, section III-C3: 30 points, the first of which must already be feasible.
    """

    obstacles: Obstacles
    weights: Array
    """(samples, 4) weights of the control rows at the sampled parameters."""

    def values(self, control: GenericArray) -> GenericArray:
        """Rows, by segment, sample and obstacle [m]."""
        return self.obstacles.signed_distance(self.weights @ control).ravel()

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients, and the segment each belongs to."""
        normal = self.obstacles.gradient(self.weights @ control)
        rows = self.weights[None, :, None, :, None] * normal[:, :, :, None, :]
        per_segment = len(self.weights) * len(self.obstacles)
        segment = np.repeat(np.arange(len(control)), per_segment)
        return rows.reshape(-1, 4, control.shape[-1]), segment


@dataclass(frozen=True, slots=True, eq=False)
class ClearanceAt:
    """Signed distance from an obstacle at the parameters where certification found a violation."""

    obstacles: Obstacles
    segment: Indices
    """(m,)."""
    obstacle: Indices
    """(m,)."""
    weights: Array
    """(m, 4) weights of the control rows at each parameter."""

    def _points(self, control: GenericArray) -> GenericArray:
        points: GenericArray = np.einsum("mk,mkd->md", self.weights, control[self.segment])
        return points

    def values(self, control: GenericArray) -> GenericArray:
        """Rows (m,) [m]."""
        distance = self.obstacles.signed_distance(self._points(control))
        return np.asarray(distance[np.arange(len(self.segment)), self.obstacle])

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients (m, 4, D), and the segment each belongs to."""
        normal = self.obstacles.gradient(self._points(control))
        normal = normal[np.arange(len(self.segment)), self.obstacle]
        return self.weights[:, :, None] * normal[:, None, :], self.segment


@dataclass(frozen=True, slots=True, eq=False)
class SpeedAt:
    """|X'(t)| at least `slowest` at the parameters where certification found a violation."""

    slowest: float
    """[m per unit t]."""
    segment: Indices
    """(m,)."""
    weights: Array
    """(m, 4) weights of the control rows in the derivative."""

    def values(self, control: GenericArray) -> GenericArray:
        """Rows (m,) [m per unit t]."""
        tangent = np.einsum("mk,mkd->md", self.weights, control[self.segment])
        return np.asarray(np.sqrt(np.sum(tangent * tangent, axis=-1)) - self.slowest)

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients (m, 4, D), and the segment each belongs to."""
        tangent = np.einsum("mk,mkd->md", self.weights, control[self.segment])
        speed = np.sqrt(np.sum(tangent * tangent, axis=-1, keepdims=True))
        unit = np.divide(tangent, speed, out=np.zeros_like(tangent), where=speed > 0.0)
        return self.weights[:, :, None] * unit[:, None, :], self.segment


@dataclass(frozen=True, slots=True, eq=False)
class InsideAt:
    """The point inside the bounds at parameters of segments that certification found outside."""

    bounds: Array
    """(2, D) [m]."""
    segment: Indices
    """(m,)."""
    weights: Array
    """(m, 4) weights of the control rows at each parameter."""

    def values(self, control: GenericArray) -> GenericArray:
        """Rows (2 m D,) [m]: above the least coordinates, then below the greatest."""
        points = np.einsum("mk,mkd->md", self.weights, control[self.segment])
        return np.concatenate([points - self.bounds[0], self.bounds[1] - points]).ravel()

    def gradients(self, control: Array) -> tuple[Array, Indices]:
        """Row gradients (2 m D, 4, D), and the segment each belongs to."""
        dimension = control.shape[-1]
        rows = self.weights[:, None, :, None] * np.eye(dimension)[None, :, None, :]
        rows = rows.reshape(-1, 4, dimension)
        return np.concatenate([rows, -rows]), np.tile(np.repeat(self.segment, dimension), 2)


def sample_weights(samples: int) -> Array:
    """Weights (samples - 1, 4) at the paper's parameters: uniform parameters without t = 0."""
    return basis(np.linspace(0.0, 1.0, samples)[1:])
