"""Products, exponentials and activations: accurate, and independent of the place in an array."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from agents.models.inference.activations import ACTIVATIONS, exponential
from agents.models.inference.matmul import ROWS, add_product, affine

Float32Array = NDArray[np.float32]


def drawn(*shape: int, seed: int = 0) -> Float32Array:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def turned(matrix: Float32Array) -> Float32Array:
    """Weights (in, out) of a matrix (out, in)."""
    return np.array(matrix.T, order="C")


@pytest.mark.parametrize("number", [0, 1, ROWS - 1, ROWS, 3 * ROWS + 2])
@pytest.mark.parametrize(("deep", "wide"), [(1, 1), (7, 64), (271, 36), (40, 32)])
def test_layers_are_those_of_linear_algebra(number: int, deep: int, wide: int) -> None:
    given, matrix, bias = drawn(number, deep), drawn(wide, deep, seed=1), drawn(wide, seed=2)
    found = affine(given, turned(matrix), bias)
    expected = given.astype(float) @ matrix.astype(float).T + bias
    np.testing.assert_allclose(found, expected, atol=3e-7 * deep, rtol=1e-6)


@pytest.mark.parametrize("number", [1, ROWS])
def test_a_sum_is_taken_in_the_order_of_its_terms_with_two_roundings_each(number: int) -> None:
    given, matrix = drawn(number, 50), drawn(3, 50, seed=1)
    sums = np.zeros((number, 3), np.float32)
    add_product(given, turned(matrix), sums)
    for row in range(number):
        expected = np.zeros(3, np.float32)
        for k in range(50):
            expected += given[row, k] * matrix[:, k]
        np.testing.assert_array_equal(sums[row], expected)


def test_rows_are_alike_in_any_company() -> None:
    given, matrix, bias = drawn(23, 271), drawn(100, 271, seed=1), drawn(100, seed=2)
    weights = turned(matrix)
    together = affine(given, weights, bias)
    order = np.random.default_rng(1).permutation(23)
    np.testing.assert_array_equal(affine(given[order], weights, bias), together[order])
    for first in range(23):
        for last in range(first + 1, 24):
            np.testing.assert_array_equal(
                affine(given[first:last], weights, bias), together[first:last]
            )


def test_sums_are_added_to_and_what_lies_beyond_is_not_read() -> None:
    given, matrix = np.full((5, 9), np.nan, np.float32), drawn(3, 7)
    given[:2, :7] = drawn(2, 7, seed=1)
    sums = np.ones((2, 3), np.float32)
    add_product(given, turned(matrix), sums)
    np.testing.assert_allclose(sums, 1.0 + given[:2, :7] @ matrix.T, rtol=1e-5, atol=1e-6)


def test_arrays_that_do_not_fit_are_refused() -> None:
    weights, sums = drawn(7, 32), np.zeros((2, 32), np.float32)
    for given, target in (
        (drawn(1, 7), sums),
        (drawn(2, 6), sums),
        (drawn(2, 7), np.zeros((2, 33), np.float32)),
    ):
        with pytest.raises(AssertionError):
            add_product(given, weights, target)


def test_exponentials_are_exact_to_two_units_in_the_last_place() -> None:
    values = np.concatenate([np.linspace(-87, 88, 20_001), [0.0, -0.0, 1e-30, -1e-8]])
    single = values.astype(np.float32)
    found = np.array([exponential(value) for value in single])
    exact = np.exp(single.astype(float))
    assert (np.abs(found - exact) <= 2.0 * np.spacing(exact.astype(np.float32))).all()
    assert exponential(np.float32(0.0)) == 1.0


def test_exponentials_beyond_their_range_are_those_of_its_ends() -> None:
    least, most = exponential(np.float32(-87.0)), exponential(np.float32(88.0))
    assert 0.0 < least < 2e-38
    assert 1e38 < most < np.inf
    for value in (-88.0, -1e30, -np.inf):
        assert exponential(np.float32(value)) == least
    for value in (89.0, 1e30, np.inf):
        assert exponential(np.float32(value)) == most


MEANT = {
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(x)),
    "gelu": lambda x: x * special.ndtr(x),
    "relu": lambda x: np.maximum(x, 0.0),
    "silu": lambda x: x * special.expit(x),
    "tanh": np.tanh,
}


@pytest.mark.parametrize("name", ACTIVATIONS)
def test_activations_are_what_their_names_say(name: str) -> None:
    values = np.concatenate([np.linspace(-30, 30, 10_001), [-1e30, 1e30]]).astype(np.float32)
    found = values.copy()
    ACTIVATIONS[name](found)
    with np.errstate(over="ignore"):
        expected = MEANT[name](values.astype(float))
    np.testing.assert_allclose(found, expected, rtol=3e-7, atol=1e-6)


@pytest.mark.parametrize("name", ACTIVATIONS)
def test_numbers_are_alike_wherever_they_stand(name: str) -> None:
    values = drawn(203)
    together = values.copy()
    ACTIVATIONS[name](together)
    for first in (*range(40), 150, 202):
        for last in (first + 1, first + 7, 203):
            part = values[first:last].copy()
            ACTIVATIONS[name](part)
            np.testing.assert_array_equal(part, together[first:last])


@pytest.mark.parametrize("name", ACTIVATIONS)
def test_what_is_no_number_stays_none(name: str) -> None:
    values = np.array([np.nan, 1.0], np.float32)
    ACTIVATIONS[name](values)
    assert np.isnan(values[0])
    assert np.isfinite(values[1])
