"""The rows of a half-plane that turns are the Bernstein coefficients of its inequality."""

from math import comb

import numpy as np
import pytest

from ferguson_gym.curves import evaluate
from planners.optimization.convex.turning_half_planes import ROWS, fill_part, fill_rows


def even_parts(number: int) -> list[np.ndarray]:
    """The weights of even parts."""
    parts = []
    for k in range(number):
        parts.append(np.empty((4, 4)))
        fill_part(k / number, (k + 1) / number, parts[-1])
    return parts


def rows_of(part: np.ndarray, control: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights and values of the rows of a disc at (3, 2) of radius 1.5 m."""
    weights, values = np.empty((ROWS, 4, 2)), np.empty(ROWS)
    first = complex(np.cos(1.0), np.sin(1.0))
    last = first * complex(np.cos(turn), np.sin(turn))
    fill_rows(part, control, first, last, 3.0, 2.0, 1.5, weights, values)
    return weights, values


@pytest.mark.parametrize("turn", [0.0, 0.4, -1.0, 2.5])
@pytest.mark.parametrize("number", [1, 3])
def test_rows_are_bernstein_coefficients_of_the_inequality(number: int, turn: float) -> None:
    control = np.random.default_rng(0).normal(size=(4, 2)) * 5.0
    for k, part in enumerate(even_parts(number)):
        _, values = rows_of(part, control, turn)
        for s in (0.0, 0.2, 0.55, 1.0):
            root = np.exp(0.5j)
            u = (1.0 - s) * root + s * root * np.exp(0.5j * turn)
            normal = u * u
            place = complex(*evaluate(control, (k + s) / number)) - (3.0 + 2.0j)
            expected = (normal.conjugate() * place).real - 1.5 * abs(normal)
            shares = [comb(5, i) * s**i * (1.0 - s) ** (5 - i) for i in range(ROWS)]
            assert values @ shares == pytest.approx(expected, abs=1e-12)


def test_rows_are_linear_in_the_segment() -> None:
    stream = np.random.default_rng(1)
    control, change = stream.normal(size=(2, 4, 2))
    part = even_parts(4)[2]
    weights, values = rows_of(part, control, 0.7)
    changed = rows_of(part, control + change, 0.7)[1]
    np.testing.assert_allclose(values + (weights * change).sum(axis=(1, 2)), changed, atol=1e-13)


def test_parts_are_pieces_of_the_segment() -> None:
    control = np.random.default_rng(2).normal(size=(4, 2))
    for k, part in enumerate(even_parts(3)):
        ends = evaluate(control, [k / 3, (k + 1) / 3])
        np.testing.assert_allclose((part @ control)[[0, 3]], ends, atol=1e-14)
