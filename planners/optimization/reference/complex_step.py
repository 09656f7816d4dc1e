"""Derivatives by complex step, as the paper takes them: exact, and slow.

Reference:
    The paper, section III-C5, whose printed formula omits h inside f; it should be
    Im f(x + i h e_k) / h. Martins, Sturdza & Alonso (2003), The complex-step derivative
    approximation, ACM TOMS 29(3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from planners.optimization.certification import Solution
from planners.optimization.nonlinear_program import Program
from planners.optimization.reference.exchange import Solver

STEP = 1e-30


def complex_step(function: Callable[[GenericArray], GenericArray], x: Array) -> Array:
    """Derivatives of a function of x (n,) with values (m,) or (): (m, n) or (n,)."""
    columns = []
    for k in range(len(x)):
        shifted = x.astype(np.complex128)
        shifted[k] += 1j * STEP
        columns.append(np.imag(function(shifted)) / STEP)
    return np.stack(columns, axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class ComplexStep:
    """A program whose gradients are taken by complex step."""

    program: Program

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest x."""
        return self.program.bounds

    def f(self, x: GenericArray) -> GenericArray:
        """Objective."""
        return self.program.f(x)

    def c(self, x: GenericArray) -> GenericArray:
        """Constraints (m,), feasible where >= 0."""
        return self.program.c(x)

    def gradient(self, x: Array) -> Array:
        """Gradient of the objective (unknowns,)."""
        return complex_step(self.program.f, x)

    def jacobian(self, x: Array) -> Array:
        """Gradients of the constraints (m, unknowns)."""
        return complex_step(self.program.c, x)


@dataclass(frozen=True, slots=True)
class ByComplexStep:
    """A solver with complex-step gradients, as in the paper."""

    solver: Solver

    def solve(self, program: Program, guess: Array) -> Solution:
        """Start at `guess` (unknowns,), which need not be feasible."""
        return self.solver.solve(ComplexStep(program), guess)
