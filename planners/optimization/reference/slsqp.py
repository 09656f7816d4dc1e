"""SciPy's SLSQP as a solver of a window's sampled program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import ThreadpoolController

from ferguson_gym.runtime.arrays import Array
from planners.optimization.certification import Solution
from planners.optimization.nonlinear_program import Program


@cache
def _thread_pools() -> ThreadpoolController:
    return ThreadpoolController()


@dataclass(frozen=True, slots=True)
class Slsqp:
    """SciPy's sequential least-squares quadratic programming, instead of the paper's fmincon.

    Reference:
        Kraft (1988), A software package for sequential quadratic programming, DFVLR-FB 88-28.
    """

    precision: float = 1e-6
    """Stop where objective and constraint violation change less than this [m]."""
    iterations: int = 100
    """Maximum number of iterations per solve."""

    def solve(self, program: Program, guess: Array) -> Solution:
        """Start at `guess` (unknowns,), which need not be feasible."""
        low, high = program.bounds
        guess = np.clip(guess, low, high)
        # the order of summation must not depend on the number of cores
        with _thread_pools().limit(limits=1, user_api="blas"):
            result = minimize(
                lambda x: float(program.f(x)),
                guess,
                jac=program.gradient,
                bounds=np.column_stack([low, high]),
                constraints={"type": "ineq", "fun": program.c, "jac": program.jacobian},
                method="SLSQP",
                options={"ftol": self.precision, "maxiter": self.iterations},
            )
        x = result.x if np.isfinite(result.x).all() else guess
        return Solution(
            x=x,
            objective=float(program.f(x)),
            converged=bool(result.success),
            status="converged" if result.success else str(result.message),
            evaluations=int(result.nfev),
        )
