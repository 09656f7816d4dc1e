"""Unknowns and rows of a chain's quadratic program.

Unknowns are the changes of the ends and end derivatives of a chain of n planar segments; a chain
that ends on the goal has its last end fixed. A row concerns one segment, so that only eight of its
entries are kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

ENTRIES = 8
"""Unknowns of a segment at most: its ends and end derivatives."""


class Weights(NamedTuple):
    """Constants of the program."""

    bending: float = 1e-5
    """Weight of the integral of |X''|^2 over t [1/m]."""
    damping: float = 1e-4
    """Weight of the square of every change: it chooses among equally long parametrisations."""
    reach: float = 1.0
    """Distance from the nominal chain within which obstacles have rows [m]."""
    turn: float = 0.5
    """Angle by which a normal turns on a part [rad] above which the part is halved, up to"""
    halvings: int = 4
    """so many times."""
    margin: float = 2e-6
    """Distance from obstacles that the rows keep, so that rounding breaks none [m]."""
    progress: float = 0.2
    """Least derivative in the direction of a segment's chord, relative to that."""
    change: float = 5.0
    """Largest change of a coordinate [m]."""


class Program(NamedTuple):
    """min 1/2 x' H x + g' x subject to A x >= b, as `planners.optimization.active_set` takes it."""

    hessian: Array
    """(m, m) H."""
    gradient: Array
    """(m,) g."""
    rows: Array
    """(r, w) entries of A for the unknowns of the row's segment."""
    offsets: NDArray[np.int64]
    """(r,) the first of these unknowns."""
    least: Array
    """(r,) b."""


@compiled
def unknowns(segments: int, final: bool) -> int:
    """Number m of unknowns of a chain."""
    return 4 * segments - 2 if final else 4 * segments


@compiled
def place_of(k: int, a: int, d: int, segments: int, final: bool) -> int:
    """The unknown that is coordinate d of row a of segment k; -1 if that is fixed."""
    if a == 0 or a == 2:
        k, a = k - 1, a + 1
    if k < 0:
        return -1
    if final and k == segments - 1:
        return -1 if a == 1 else 4 * k + d
    return 4 * k + d if a == 1 else 4 * k + 2 + d


@compiled
def add_row(
    weights: Array, least: float, k: int, n: int, final: bool, count: int, out: Program
) -> int:
    """Add the row weights . change >= least of a segment; returns the number of rows."""
    some = False
    row = out.rows[count]
    row[:] = 0.0
    offset = max(min(4 * (k - 1), len(out.gradient) - len(row)), 0)
    for a in range(4):
        for d in range(2):
            place = place_of(k, a, d, n, final)
            if place >= 0 and weights[a, d] != 0.0:
                row[place - offset] += weights[a, d]
                some = True
    if not some:  # nothing can change it
        return count
    out.offsets[count], out.least[count] = offset, least
    return count + 1
