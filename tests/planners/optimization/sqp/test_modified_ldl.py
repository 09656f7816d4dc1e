"""Symmetric matrices made positive definite: near, and never wild."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.optimization.sqp.modified_ldl import make_definite

FLOOR = 3e-2
SIZES = range(1, 15)


def definite(matrix: np.ndarray, floor: float = FLOOR) -> np.ndarray:
    out = np.full_like(matrix, np.nan)
    make_definite(matrix, floor, out)
    return out


def symmetric(stream: np.random.Generator, eigenvalues: np.ndarray) -> np.ndarray:
    turn, _ = np.linalg.qr(stream.normal(size=(len(eigenvalues), len(eigenvalues))))
    matrix = turn @ np.diag(eigenvalues) @ turn.T
    return 0.5 * (matrix + matrix.T)


def assert_sane(matrix: np.ndarray, floor: float = FLOOR) -> None:
    """Positive definite, symmetric, at least the matrix, and not much larger."""
    kept = matrix.copy()
    out = definite(matrix, floor)
    np.testing.assert_array_equal(matrix, kept)
    assert np.isfinite(out).all()
    np.testing.assert_array_equal(out, out.T)
    np.linalg.cholesky(out)
    size = np.linalg.norm(matrix, 2)
    largest, least = np.linalg.eigvalsh(out)[[-1, 0]]
    assert largest <= 50.0 * (size + floor)
    assert least > 0.0
    # eigenvalues of the factorisation are only raised
    assert np.linalg.eigvalsh(out - matrix)[0] >= -1e-9 * (size + floor)


@pytest.mark.parametrize("n", SIZES)
def test_a_matrix_that_is_definite_enough_stays_as_it_is(n: int) -> None:
    stream = np.random.default_rng(n)
    for _ in range(50):
        matrix = symmetric(stream, np.exp(stream.uniform(np.log(1.1 * FLOOR), np.log(1e3), n)))
        np.testing.assert_allclose(definite(matrix), matrix, rtol=0, atol=1e-11)


@pytest.mark.parametrize("n", SIZES)
def test_any_symmetric_matrix_becomes_definite(n: int) -> None:
    stream = np.random.default_rng(n)
    for _ in range(100):
        eigenvalues = stream.normal(size=n) * 10.0 ** stream.uniform(-3.0, 3.0, n)
        assert_sane(symmetric(stream, eigenvalues))
        eigenvalues[stream.integers(0, n, n // 2 + 1)] = 0.0
        assert_sane(symmetric(stream, eigenvalues))


@given(
    n=st.integers(1, 14),
    seed=st.integers(0, 2**32 - 1),
    sizes=st.sampled_from([(0.0,), (-1.0, 0.0, 1.0), (0.0, 1e-9, 1e9), (-1e-12, 1.0), (-1e6, 1e6)]),
)
@settings(deadline=None, max_examples=300, derandomize=True)
def test_matrices_of_few_values_become_definite(
    n: int, seed: int, sizes: tuple[float, ...]
) -> None:
    lower = np.tril(np.random.default_rng(seed).choice(sizes, (n, n)))
    assert_sane(lower + np.tril(lower, -1).T)


@pytest.mark.parametrize("negative", range(5))
def test_only_as_many_directions_change_as_were_negative(negative: int) -> None:
    stream = np.random.default_rng(negative)
    for _ in range(50):
        signs = np.where(np.arange(12) < negative, -1.0, 1.0)
        matrix = symmetric(stream, signs * stream.uniform(1.0, 10.0, 12))
        changed = np.linalg.eigvalsh(definite(matrix, 1e-9) - matrix)
        assert (changed > 1e-8).sum() == negative


@pytest.mark.parametrize("n", SIZES)
def test_nothing_becomes_the_floor(n: int) -> None:
    np.testing.assert_array_equal(definite(np.zeros((n, n)), 0.5), 0.5 * np.eye(n))


def test_of_a_negative_eigenvalue_a_part_is_kept() -> None:
    matrix = np.diag([4.0, -10.0, 1e-3, 0.0, -0.04])
    np.testing.assert_allclose(definite(matrix), np.diag([4.0, 3.0, FLOOR, FLOOR, FLOOR]))


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.785])
@pytest.mark.parametrize("eigenvalues", [(2.0, -2.0), (1.0, -3.0), (5.0, -4.0)])
def test_a_pair_of_rows_keeps_its_directions(
    angle: float, eigenvalues: tuple[float, float]
) -> None:
    # around 45 degrees no diagonal pivot is taken
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = turn @ np.diag(eigenvalues) @ turn.T
    diagonal = abs(np.diag(matrix)).max()
    if diagonal >= (1.0 + np.sqrt(17.0)) / 8.0 * abs(matrix[0, 1]):
        assert_sane(matrix)
        return
    raised = np.diag([eigenvalues[0], -0.3 * eigenvalues[1]])
    np.testing.assert_allclose(definite(matrix), turn @ raised @ turn.T, atol=1e-12)


def test_the_floor_bounds_steps_along_flat_directions() -> None:
    stream = np.random.default_rng(0)
    for _ in range(100):
        matrix = symmetric(stream, np.array([0.0, 0.0, 1.0, 10.0, -5.0]))
        for floor in (1e-6, 1e-2, 1.0):
            assert np.linalg.eigvalsh(definite(matrix, floor))[0] > 0.05 * floor
