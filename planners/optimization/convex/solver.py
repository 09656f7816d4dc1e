"""Write and solve the quadratic program of a chain in one compiled call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, unowned
from planners.optimization.active_set import SOLVED, minimise
from planners.optimization.convex.obstacle_rows import Surroundings
from planners.optimization.convex.program import Terminal, assemble
from planners.optimization.convex.rows import Weights, place_of


class Caps(NamedTuple):
    """Upper limits of a program."""

    rows: int = 800
    """Maximum number of rows."""
    iterations: int = 250
    """Maximum number of iterations."""


class Solution(NamedTuple):
    """What solving a program took, and led to."""

    found: bool
    """Whether it was solved; not if it has no solution, or needs more than the caps allow."""
    control: Array
    """Chain (n, 4, 2) [m]; the nominal one if the program was not solved."""
    rows: int
    """Number of rows; zero if they were too many."""
    iterations: int


@compiled
def solve(
    control: Array,
    terminal: Terminal,
    parts: int,
    bounds: Array,
    around: Surroundings,
    shortest: float,
    given: Weights,
    caps: Caps,
) -> Solution:
    """The chain that solves the program of a nominal chain, written by `assemble`.

    Args:
        control: (n, 4, 2) nominal chain [m].
        terminal: of the chain.
        parts: of each segment.
        bounds: (2, 2) of the field [m].
        around: obstacles of the field.
        shortest: length of a segment at least [m].
        given: constants.
        caps: of the program.
    """
    around = unowned(around)  # the caller holds it
    fits, program = assemble(control, terminal, parts, bounds, around, shortest, given, caps.rows)
    if not fits:
        return Solution(False, control, 0, 0)
    change = np.empty(len(program.gradient))
    status, iterations = minimise(
        program.hessian,
        program.gradient,
        program.rows,
        program.offsets,
        program.least,
        change,
        caps.iterations,
    )
    if status != SOLVED:
        return Solution(False, control, len(program.rows), iterations)
    result, n = control.copy(), len(control)
    for k in range(n):
        for a in range(4):
            for d in range(2):
                place = place_of(k, a, d, n, terminal.final)
                if place >= 0:
                    result[k, a, d] += change[place]
    return Solution(True, result, len(program.rows), iterations)
