"""A window as a sampled nonlinear program: minimise f(x) subject to c(x) >= 0 and a box.

It is for the reference solvers (SLSQP, IPOPT); the elastic SQP expands windows itself, in
`planners.optimization.sqp.expansion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from planners.optimization.chain import Chain
from planners.optimization.objectives import Objective
from planners.optimization.quadrature import BENDING, bending, length_gradients, lengths
from planners.optimization.sampled_constraints import Constraint


class Program(Protocol):
    """A nonlinear program as the reference solvers see it."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest x."""

    def f(self, x: GenericArray) -> GenericArray:
        """Objective."""

    def c(self, x: GenericArray) -> GenericArray:
        """Constraints (m,), feasible where >= 0."""

    def gradient(self, x: Array) -> Array:
        """Gradient of the objective (unknowns,)."""

    def jacobian(self, x: Array) -> Array:
        """Gradients of the constraints (m, unknowns)."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Objective and constraints of a chain, as functions of its unknowns, with gradients."""

    chain: Chain
    objective: Objective
    constraints: Sequence[Constraint]
    bounds: tuple[Array, Array]
    bending_weight: float = 0.0
    """Weight of the bending in the objective [1/m]."""

    def f(self, x: GenericArray) -> GenericArray:
        """Objective."""
        control = self.chain.control(x)
        value = self.objective.value(np.sum(lengths(control)), control[-1, 1])
        return value + self.bending_weight * bending(control)

    def c(self, x: GenericArray) -> GenericArray:
        """Constraints (m,), feasible where >= 0."""
        control = self.chain.control(x)
        return np.concatenate([constraint.values(control) for constraint in self.constraints])

    def gradient(self, x: Array) -> Array:
        """Gradient of the objective (unknowns,), by the chain rule."""
        control = self.chain.control(x)
        length = float(np.sum(lengths(control)))
        _, slope, _ = self.objective.expand(length, control[-1, 1])
        rows = slope[0] * length_gradients(control)
        rows[-1, 1] += slope[1:]
        rows += 2.0 * self.bending_weight * (BENDING @ control)
        return np.asarray(self.chain.chain_rule(rows, np.arange(len(rows))).sum(axis=0))

    def jacobian(self, x: Array) -> Array:
        """Gradients of the constraints (m, unknowns), by the chain rule."""
        control = self.chain.control(x)
        pairs = [constraint.gradients(control) for constraint in self.constraints]
        rows = np.concatenate([rows for rows, _ in pairs])
        return self.chain.chain_rule(rows, np.concatenate([segment for _, segment in pairs]))

    def joined_by(self, constraints: Sequence[Constraint]) -> Problem:
        """The same problem with further constraints."""
        return replace(self, constraints=[*self.constraints, *constraints])
