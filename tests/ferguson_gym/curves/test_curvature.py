"""The greatest curvature against dense samples and a search in exact numbers."""

import math
import time

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ferguson_gym.curves.splines import derivative, max_curvature, subdivide
from ferguson_gym.runtime.arrays import LARGEST, Array
from tests.support.sharpest_reference import reference, slowest

PROPERTY = settings(max_examples=40, deadline=None, derandomize=True)
DIMENSIONS = st.integers(2, 4)
COORDINATES = st.floats(-20, 20).map(lambda value: round(value, 6))
SMALL = st.floats(-10.0, -1.0).map(lambda power: 10.0**power)


def vectors(rows: int, dimension: int) -> st.SearchStrategy[Array]:
    return arrays(np.float64, (rows, dimension), elements=COORDINATES)


def from_derivative(at: Array) -> Array:
    """The segment from the origin whose derivative at 0, 1/2 and 1 is given, (3, D)."""
    first, middle, last = at
    end = (first + 4.0 * middle + last) / 6.0
    return np.array([0.0 * end, end, first, last])


def agrees(control: Array) -> None:
    """To 1e-9, but for what rounding the control array alone changes near a standstill."""
    _, slow = slowest(control)
    assume(slow > 1e-9)  # the reference finds nothing narrower
    speed = np.linalg.norm(derivative(control, [0.0, 0.5, 1.0]), axis=-1).max()
    felt = 8.0 * 2.0**-52 * np.abs(control).max() / speed / slow
    assert max_curvature(control) == pytest.approx(reference(control), rel=1e-9 + felt, abs=1e-12)


@PROPERTY
@given(DIMENSIONS.flatmap(lambda dimension: vectors(4, dimension)))
def test_greatest_curvature_agrees_with_refined_samples(control: Array) -> None:
    assume(control[2:].any() or (control[0] != control[1]).any())
    agrees(control)


@PROPERTY
@given(DIMENSIONS.flatmap(lambda d: vectors(3, d)), st.floats(0.0, 1.0), SMALL)
def test_greatest_curvature_near_a_cusp(rows: Array, at: float, small: float) -> None:
    turn, more, aside = rows
    assume(np.abs(turn).max() > 1.0)
    t = np.array([0.0, 0.5, 1.0])[:, None]
    agrees(from_derivative((t - at) * (turn + t * more) + small * aside))


@PROPERTY
@given(st.tuples(st.floats(0, 1), st.floats(0, 1)), vectors(3, 2), SMALL)
def test_greatest_curvature_near_two_cusps(
    at: tuple[float, float], rows: Array, small: float
) -> None:
    along, aside, more = rows
    assume(np.abs(along).max() > 1.0)
    t = np.array([0.0, 0.5, 1.0])[:, None]
    agrees(from_derivative((t - at[0]) * (t - at[1]) * along + small * (aside + t * more)))


@PROPERTY
@given(vectors(1, 3), st.lists(COORDINATES, min_size=4, max_size=4), vectors(4, 3), SMALL)
def test_greatest_curvature_near_a_line(
    along: Array, places: list[float], aside: Array, small: float
) -> None:
    assume(np.abs(along).max() > 1.0)
    control = np.outer(places, along[0]) + small * aside
    assume(np.abs(np.diff(control, axis=0)).max() > 0.01)
    agrees(control)


@PROPERTY
@given(DIMENSIONS.flatmap(lambda d: vectors(3, d)), st.sampled_from([0, 1, 2]), SMALL)
def test_greatest_curvature_of_degenerate_degree(rows: Array, which: int, small: float) -> None:
    start, end, other = rows
    assume(np.abs(start).max() > 1.0)
    assume(np.abs(end).max() > 1.0)
    halfway = 0.5 * (start + end)  # of degree 2, nearly of degree 2, and nearly of degree 1
    agrees(from_derivative(np.array([start, halfway + (0.0, small, 1.0)[which] * other, end])))
    agrees(from_derivative(np.array([start, start + small * other, start])))


@PROPERTY
@given(DIMENSIONS.flatmap(lambda d: vectors(4, d)), st.floats(-120, 120), st.floats(0.1, 0.9))
def test_greatest_curvature_under_scaling_reversal_and_subdivision(
    control: Array, power: float, split: float
) -> None:
    assume(np.abs(control[2:]).max() > 0.1)
    _, slow = slowest(control)
    assume(slow > 1e-3)
    whole = max_curvature(control)
    scale = 2.0 ** round(power * 3)
    assert max_curvature(control * scale) == pytest.approx(whole / scale, rel=1e-12)
    backwards = control[[1, 0, 3, 2]] * np.array([1.0, 1.0, -1.0, -1.0])[:, None]
    assert max_curvature(backwards) == pytest.approx(whole, rel=1e-9)
    parts = max_curvature(np.stack(subdivide(control, split)))
    assert parts.max() == pytest.approx(whole, rel=1e-8)


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("place", [0.0, 1e3])
def test_lines_have_no_curvature_and_lines_that_turn_back_have_cusps(
    dimension: int, place: float
) -> None:
    stream = np.random.default_rng(dimension)
    for _ in range(200):
        along = stream.normal(size=dimension)
        start, end, leave, arrive = stream.uniform(0.5, 3.0, size=4) * [0.0, 1.0, 1.0, 1.0]
        shift = place * stream.normal(size=dimension)
        control = np.outer([start, end, leave, arrive], along) + np.outer([1, 1, 0, 0], shift)
        # the way is at least a third of both derivatives: nothing turns back
        control[1] = control[0] + max(end, leave, arrive) * along
        assert max_curvature(control) == 0.0
        back = control * np.array([1, 1, 1, -1])[:, None]
        if place == 0.0:
            assert max_curvature(back) == np.inf


@pytest.mark.parametrize("at", [0.0, 0.25, 1.0 / 3.0, 0.7, 1.0])
def test_a_vanishing_derivative_is_a_cusp_wherever_it_is(at: float) -> None:
    t = np.array([0.0, 0.5, 1.0])[:, None]
    for power in (1, 2):  # a turn back, and a halt on a line
        for along in np.random.default_rng(0).normal(size=(20, 2)):
            v = (t - at) ** power * (along + (2 - power) * t * along[::-1])
            assert max_curvature(from_derivative(v)) == np.inf


def test_the_largest_numbers_do_not_overflow() -> None:
    control = np.array([[0.0, 0.0], [1.0, -1.0], [1.0, 0.5], [-1.0, 1.0]])
    small, scale = max_curvature(control), 2.0 ** math.floor(math.log2(LARGEST))
    assert max_curvature(control * scale) == pytest.approx(small / scale, rel=1e-9)


def test_batches_agree_with_single_segments_and_are_fast() -> None:
    control = np.random.default_rng(3).normal(size=(10_000, 4, 2))
    together = max_curvature(control)
    assert [float(max_curvature(one)) for one in control[:50]] == together[:50].tolist()
    began = time.process_time()
    max_curvature(control)
    assert time.process_time() - began < 0.5  # 50 us each; on a quiet machine, less than 2
