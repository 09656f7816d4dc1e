"""Solve the quadratic program of a chain by DAQP, an active-set method with a cap of iterations.

Reference:
    Arnström, Bemporad & Axehill (2022), A dual active-set solver for embedded quadratic
    programming using recursive LDL' updates, IEEE Transactions on Automatic Control 67(8).
"""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.convex.program import Program, place_of


class Solution(NamedTuple):
    """What solving a program took, and led to."""

    control: Array | None
    """Chain (n, 4, 2) [m]; None if the program is infeasible or the cap was reached."""
    rows: int
    iterations: int


def solve(program: Program, control: Array, final: bool, cap: int) -> Solution:
    """The chain that solves the program of a nominal chain (n, 4, 2).

    Args:
        program: assembled for the chain.
        control: nominal chain (n, 4, 2) [m].
        final: whether the chain ends on the goal.
        cap: maximum number of iterations.
    """
    sense = np.zeros(len(program.lower), np.int32)
    change, _, flag, info = daqp.solve(
        program.hessian,
        program.gradient,
        program.rows,
        program.upper,
        program.lower,
        sense,
        primal_tol=1e-9,
        iter_limit=cap,
    )
    found = _changed(control, change, final) if flag > 0 else None
    return Solution(found, len(program.rows), int(info["iterations"]))


@compiled
def _changed(control: Array, change: Array, final: bool) -> Array:
    """A chain with changed unknowns."""
    result = control.copy()
    for k in range(len(control)):
        for a in range(4):
            for d in range(2):
                place = place_of(k, a, d, len(control), final)
                if place >= 0:
                    result[k, a, d] += change[place]
    return result
