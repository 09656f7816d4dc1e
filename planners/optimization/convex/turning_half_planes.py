"""Half-planes that turn along a part of a segment, as rows linear in the segment, compiled.

On a part of a segment, with parameter s in [0, 1], let the complex number n(s) = u(s)^2 be the
normal of a half-plane, u(s) = (1 - s) u0 + s u1. It turns from u0^2 to u1^2, and |n| = |u|^2 is a
quadratic polynomial, so that

    n(s) . (X(s) - c) - r |n(s)| >= 0

is a polynomial inequality of degree 5, linear in the control array of the segment X. It keeps the
part farther than r from the point c. Its six Bernstein coefficients are its rows: if none is
negative, the inequality holds everywhere on the part. For a core of several corners, every corner
that supports it in the direction of a normal has its own rows.

Reference:
    Farouki & Rajan (1988), Algorithms for polynomials in Bernstein form, Computer Aided
    Geometric Design 5(1).
"""

from __future__ import annotations

from math import comb

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

ROWS = 6
"""Bernstein coefficients of a polynomial of degree 5."""
_PRODUCT = np.array(
    [[comb(2, i) * comb(3, j) / comb(5, i + j) for j in range(4)] for i in range(3)]
)
"""Weights (3, 4) of coefficients i and j of factors of degree 2 and 3 in coefficient i + j of their
product."""
_TO_BEZIER = np.array([[1, 0, 0, 0], [1, 0, 1 / 3, 0], [0, 1, 0, -1 / 3], [0, 1, 0, 0]])


@compiled
def fill_part(begin: float, end: float, part: Array) -> None:
    """Fill the Bézier points of a part of a segment, as weights of the rows of its control array.

    Args:
        begin: of the part, in [0, 1].
        end: of the part.
        part: (4, 4), filled: `part @ control` are the points (4, 2).
    """
    for ends in range(4):  # the blossom at 3 - `ends` times the begin and `ends` times the end
        for a in range(4):
            one, two, three, four = (
                _TO_BEZIER[0, a],
                _TO_BEZIER[1, a],
                _TO_BEZIER[2, a],
                _TO_BEZIER[3, a],
            )
            t = begin if ends < 3 else end
            one, two, three = (
                one + t * (two - one),
                two + t * (three - two),
                three + t * (four - three),
            )
            t = begin if ends < 2 else end
            one, two = one + t * (two - one), two + t * (three - two)
            t = begin if ends < 1 else end
            part[ends, a] = one + t * (two - one)


@compiled
def fill_rows(
    part: Array,
    control: Array,
    first: complex,
    last: complex,
    x: float,
    y: float,
    radius: float,
    weights: Array,
    values: Array,
) -> None:
    """Fill the rows of a part of a segment that keep it from a corner.

    Args:
        part: (4, 4) of `fill_part`.
        control: (4, 2) segment at which the values are those of the inequality [m].
        first: unit normal at the part's begin, away from the corner.
        last: unit normal at its end.
        x: of the corner [m].
        y: of the corner [m].
        radius: distance to keep [m].
        weights: (ROWS, 4, 2) of the rows of the control array, filled.
        values: (ROWS,) of the rows at `control`, filled [m].
    """
    root = np.sqrt(first)
    turned = root * np.sqrt(last * first.conjugate())
    normals = (root * root, root * turned, turned * turned)
    sizes = (1.0, (root * turned.conjugate()).real, 1.0)
    weights[:] = 0.0
    for k in range(ROWS):
        values[k] = 0.0
    for i in range(3):
        normal = normals[i]
        for j in range(4):
            weight, row = _PRODUCT[i, j], weights[i + j]
            values[i + j] -= weight * (normal.real * x + normal.imag * y + radius * sizes[i])
            for a in range(4):
                row[a, 0] += weight * normal.real * part[j, a]
                row[a, 1] += weight * normal.imag * part[j, a]
    for k in range(ROWS):
        for a in range(4):
            values[k] += weights[k, a, 0] * control[a, 0] + weights[k, a, 1] * control[a, 1]
