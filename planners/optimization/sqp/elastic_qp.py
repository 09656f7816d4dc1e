"""The elastic quadratic program of one step, solved by DAQP.

    minimise    g.p + 1/2 p.H p + nu sum s
    subject to  c + A p >= -s,   s >= 0,   low <= x + p <= high,   |p_i| <= radius scale_i

where c contains the length constraints and the contacts that a step within the trust region can
reach.

Reference:
    Arnström, Bemporad & Axehill (2022), A dual active-set solver for embedded quadratic
    programming using recursive LDL' updates, IEEE Transactions on Automatic Control 67(8).
"""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.expansion import Expansion
from planners.optimization.sqp.turn_contacts import LEFT, TURN_RATIO

_REACH = 2.5
"""Upper bound on the displacement [m] of any curve point for a step of 1 m in every point and 3 m
in every derivative."""
_PRICE = 1e4
"""nu. DAQP applies it to rows scaled by H, which does not matter: where the constraints can be
satisfied, any sufficiently large penalty gives the same step."""
_ITERATIONS, _ITERATIONS_EACH = 300, 15
"""Maximum number of iterations of DAQP, which might otherwise cycle; and at least so many for each
unknown."""
_SOFT = 8
"""DAQP's flag for soft constraints."""


class Rows(NamedTuple):
    """A quadratic program in the form of DAQP."""

    slopes: Array
    """(rows, m)."""
    lower: Array
    """(m + rows,) of the unknowns, then of the rows."""
    upper: Array
    """(m + rows,)."""
    sense: NDArray[np.int32]
    """(m + rows,) zero for the unknowns, soft for the rows."""
    taken: Integers
    """The contact of each row after those of the lengths."""


def empty_rows(segments: int, unknowns: int, contacts: int) -> Rows:
    """Memory for a quadratic program."""
    rows = segments + contacts
    sense = np.full(unknowns + rows, _SOFT, np.int32)
    sense[:unknowns] = 0
    return Rows(
        slopes=np.empty((rows, unknowns)),
        lower=np.empty(unknowns + rows),
        upper=np.full(unknowns + rows, 1e30),
        sense=sense,
        taken=np.empty(contacts, np.int64),
    )


def reach(radius: float) -> float:
    """Clearance [m] below which a contact may matter to a step within the radius."""
    return _REACH * radius


@compiled
def _fill(
    here: Expansion,
    contacts: int,
    x: Array,
    low: Array,
    high: Array,
    scale: Array,
    radius: float,
    limits: Array,
    out: Rows,
) -> int:
    """Fill in the quadratic program; return its number of rows."""
    m, segments = len(x), len(here.length)
    for i in range(m):
        out.lower[i] = max(low[i] - x[i], -radius * scale[i])
        out.upper[i] = min(high[i] - x[i], radius * scale[i])
    for k in range(segments):
        out.slopes[k] = here.length_slope[k]
        out.lower[m + k], out.upper[m + k] = limits[0] - here.length[k], limits[1] - here.length[k]
    count = segments
    for row in range(contacts):
        swing = 1.0 if here.contact[row].what > LEFT else TURN_RATIO
        if here.contact[row].clearance < swing * _REACH * radius:
            out.slopes[count] = here.slope[row]
            out.lower[m + count] = -here.contact[row].clearance
            out.taken[count - segments] = row
            count += 1
    return count


def solve(
    here: Expansion,
    contacts: int,
    x: Array,
    box: tuple[Array, Array],
    scale: Array,
    radius: float,
    limits: Array,
    gradient: Array,
    hessian: Array,
    rows: Rows,
) -> tuple[Array | None, Array]:
    """The step (m,), None if DAQP failed, and the multipliers (rows,), >= 0 at lower bounds."""
    end = len(x) + _fill(here, contacts, x, *box, scale, radius, limits, rows)
    p, _, flag, info = daqp.solve(
        hessian,
        gradient,
        rows.slopes[: end - len(x)],
        rows.upper[:end],
        rows.lower[:end],
        rows.sense[:end],
        primal_tol=1e-9,
        iter_limit=max(_ITERATIONS, _ITERATIONS_EACH * len(x)),
        rho_soft=1e4,
        w_soft=_PRICE,
    )
    return (p if flag > 0 else None), -info["lam"][len(x) :]
