"""Ferguson segments against polynomials, the cross product and dense samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial import Polynomial
from scipy.optimize import minimize_scalar

from ferguson_gym.curves.splines import (
    as_control,
    curvature,
    derivative,
    evaluate,
    extent,
    from_bezier,
    max_curvature,
    subdivide,
    to_bezier,
)

PROPERTY = settings(max_examples=100, deadline=None, derandomize=True)
COORDINATES = st.floats(-20, 20).map(lambda value: round(value, 6))
SEGMENTS = st.integers(1, 3).flatmap(
    lambda dimension: arrays(np.float64, (4, dimension), elements=COORDINATES)
)
T = np.linspace(0.0, 1.0, 201)


def from_polynomials(*coordinates):
    """The control array of a curve with these cubic polynomials as coordinates."""
    slopes = [coordinate.deriv() for coordinate in coordinates]
    rows = ((coordinates, 0.0), (coordinates, 1.0), (slopes, 0.0), (slopes, 1.0))
    return np.array([[polynomial(t) for polynomial in row] for row, t in rows])


def random_segments(count, dimension, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 4, dimension)) * 10.0


@PROPERTY
@given(SEGMENTS)
def test_ends_are_the_control_rows(control):
    ends = np.concatenate([evaluate(control, [0.0, 1.0]), derivative(control, [0.0, 1.0])])
    np.testing.assert_allclose(ends, control, rtol=0, atol=1e-13)


@PROPERTY
@given(arrays(np.float64, st.tuples(st.integers(1, 3), st.just(4)), elements=COORDINATES))
def test_every_cubic_polynomial_is_reproduced_with_its_derivatives(coefficients):
    cubics = [Polynomial(row) for row in coefficients]
    control = from_polynomials(*cubics)
    for order in range(4):
        expected = np.stack([cubic.deriv(order)(T) for cubic in cubics], axis=-1)
        found = evaluate(control, T) if order == 0 else derivative(control, T, order)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
@pytest.mark.parametrize("t", [0, 0.25, np.float64(1.0), np.array(0.5)])
def test_one_parameter_gives_one_point_of_each_segment(batch, t):
    control = np.random.default_rng(1).normal(size=(*batch, 4, 2))
    for function in (evaluate, derivative, curvature):
        expected = function(control, [float(t)])
        axis = -1 if function is curvature else -2
        found = function(control, t)
        assert found.shape == (*batch, *(() if function is curvature else (2,)))
        np.testing.assert_allclose(found, expected.take(0, axis), rtol=1e-14, atol=1e-14)


def test_batches_of_any_shape_are_evaluated_one_by_one():
    control = random_segments(6, 3).reshape(2, 3, 4, 3)
    points, slopes = evaluate(control, T), derivative(control, T)
    assert points.shape == slopes.shape == (2, 3, len(T), 3)
    np.testing.assert_allclose(points[1, 2], evaluate(control[1, 2], T), rtol=1e-14)
    np.testing.assert_allclose(slopes[1, 2], derivative(control[1, 2], T), rtol=1e-14)


def test_complex_control_arrays_keep_their_imaginary_part():
    real, imaginary = random_segments(2, 2)
    for function in (evaluate, derivative, lambda c, t: to_bezier(c)):
        found = function(real + 1e-30j * imaginary, T)
        np.testing.assert_allclose(found.real, function(real, T), rtol=1e-14)
        np.testing.assert_allclose(found.imag, 1e-30 * function(imaginary, T), rtol=1e-12)


@PROPERTY
@given(SEGMENTS)
def test_bezier_points_give_the_same_curve_and_come_back(control):
    points = to_bezier(control)
    np.testing.assert_allclose(from_bezier(points), control, rtol=0, atol=1e-12)
    t = T[:, None]
    bernstein = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    curve = sum(weight * point for weight, point in zip(bernstein, points, strict=True))
    np.testing.assert_allclose(evaluate(control, T), curve, rtol=0, atol=1e-12)


@PROPERTY
@given(SEGMENTS, st.floats(0.01, 0.99))
def test_subdivision_gives_the_same_curve_with_scaled_derivatives(control, split):
    left, right = subdivide(control, split)
    for part, start, width in ((left, 0.0, split), (right, split, 1.0 - split)):
        whole = start + width * T
        np.testing.assert_allclose(evaluate(part, T), evaluate(control, whole), rtol=0, atol=1e-12)
        np.testing.assert_allclose(
            derivative(part, T), width * derivative(control, whole), rtol=0, atol=1e-11
        )


def test_subdivision_keeps_the_shape_of_the_batch():
    control = random_segments(6, 2).reshape(3, 2, 4, 2)
    left, right = subdivide(control)
    assert left.shape == right.shape == control.shape
    np.testing.assert_array_equal(left[2, 1], subdivide(control[2, 1])[0])


@pytest.mark.parametrize("t", [0.0, 1.0, -0.5, 2.0, np.nan])
def test_subdivision_refuses_a_split_outside_the_segment(t):
    with pytest.raises(ValueError, match=f"got t = {t}"):
        subdivide(np.zeros((4, 2)), t)


def test_curvature_is_the_cross_product_over_the_cubed_speed():
    for control in random_segments(20, 3):
        first, second = derivative(control, T), derivative(control, T, 2)
        expected = np.linalg.norm(np.cross(first, second), axis=-1)
        expected /= np.linalg.norm(first, axis=-1) ** 3
        np.testing.assert_allclose(curvature(control, T), expected, rtol=1e-9)


def test_curvature_does_not_change_with_dimension_or_parametrisation():
    plane = random_segments(20, 2)
    space = np.concatenate([plane, np.zeros((20, 4, 1))], axis=-1)
    np.testing.assert_allclose(curvature(space, T), curvature(plane, T), rtol=1e-12)
    left, _ = subdivide(plane, 0.25)
    np.testing.assert_allclose(curvature(left, T), curvature(plane, 0.25 * T), rtol=1e-7)


def test_curvature_is_infinite_where_the_derivative_vanishes():
    control = np.array([[0.0, 0.0], [10.0, 5.0], [0.0, 0.0], [3.0, 9.0]])
    at_rest, moving = curvature(control, [0.0, 0.5])
    assert at_rest == np.inf
    assert moving < np.inf


@pytest.mark.parametrize("dimension", [2, 3])
def test_greatest_curvature_bounds_dense_samples_and_is_attained(dimension):
    control = random_segments(60, dimension, seed=dimension)
    greatest = max_curvature(control)
    dense = np.linspace(0.0, 1.0, 2001)
    samples = curvature(control, dense)
    assert (greatest >= samples.max(axis=-1) * (1 - 1e-9)).all()
    for one, most, peak in zip(control, greatest, dense[samples.argmax(axis=-1)], strict=True):
        found = minimize_scalar(
            lambda t, one=one: -curvature(one, [t])[0],
            bounds=(max(0.0, peak - 1e-3), min(1.0, peak + 1e-3)),
            method="bounded",
            options={"xatol": 1e-12},
        )
        attained = max(-found.fun, *curvature(one, [0.0, 1.0]))
        assert most == pytest.approx(attained, rel=1e-6)


def test_greatest_curvature_of_a_parabola_is_at_its_vertex():
    # y = a x^2 has curvature 2 a at its vertex
    for a, start, end in ((0.5, -1.0, 2.0), (3.0, -0.1, 0.7), (7.0, 0.0, 1.0)):
        x = Polynomial([start, end - start])
        assert max_curvature(from_polynomials(x, a * x**2)) == pytest.approx(2 * a, rel=1e-12)


def test_greatest_curvature_keeps_the_shape_of_the_batch():
    control = random_segments(6, 2).reshape(2, 3, 4, 2)
    together = max_curvature(control)
    assert together.shape == (2, 3)
    assert together[1, 1] == max_curvature(control[1, 1])


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("derivatives", [(5.0, 5.0), (1.0, 9.0), (9.0, 4.0)])
def test_greatest_curvature_of_a_line_is_zero(angle, derivatives):
    direction = np.array([np.cos(angle), np.sin(angle)])
    control = np.array([0.0, 5.0, *derivatives])[:, None] * direction
    assert max_curvature(control) <= (0.0 if angle == 0.0 else 1e-12)


@pytest.mark.parametrize("row", [2, 3])
def test_greatest_curvature_is_infinite_at_a_vanishing_end_derivative(row):
    control = np.array([[0.0, 0.0], [10.0, 5.0], [2.0, 9.0], [3.0, 9.0]])
    control[row] = 0.0
    assert max_curvature(control) == np.inf


def test_a_point_has_infinite_curvature():
    assert max_curvature([[3.0, 4.0], [3.0, 4.0], [0.0, 0.0], [0.0, 0.0]]) == np.inf


@PROPERTY
@given(SEGMENTS)
def test_extent_is_attained_at_ends_and_stationary_points(control):
    low, high = extent(control)
    for axis, (start, end, leave, arrive) in enumerate(control.T):
        way = end - start
        cubic = Polynomial([start, leave, 3 * way - 2 * leave - arrive, leave + arrive - 2 * way])
        stationary = np.clip(cubic.deriv().roots().real, 0.0, 1.0)
        values = [start, end, *cubic(stationary)]
        assert low[axis] == pytest.approx(min(values), abs=1e-12)
        assert high[axis] == pytest.approx(max(values), abs=1e-12)


@PROPERTY
@given(SEGMENTS)
def test_extent_holds_dense_samples_tightly(control):
    samples = evaluate(control, np.linspace(0.0, 1.0, 1001))
    low, high = extent(control)
    # between samples a coordinate passes them by at most |X''| h^2 / 8
    slack = np.abs(derivative(control, [0.0, 1.0], 2)).max() * 1e-6 / 8 + 1e-13
    assert (low <= samples.min(axis=0) + 1e-13).all()
    assert (high >= samples.max(axis=0) - 1e-13).all()
    assert (low >= samples.min(axis=0) - slack).all()
    assert (high <= samples.max(axis=0) + slack).all()


def test_extent_keeps_the_shape_of_the_batch():
    control = random_segments(6, 3).reshape(2, 3, 4, 3)
    low, high = extent(control)
    assert low.shape == high.shape == (2, 3, 3)
    np.testing.assert_array_equal(low[1, 0], extent(control[1, 0])[0])
    np.testing.assert_array_equal(high[1, 0], extent(control[1, 0])[1])


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (np.zeros(4), r"got \(4,\)"),
        (np.zeros((3, 2)), r"got \(3, 2\)"),
        (np.zeros((4, 0)), r"got \(4, 0\)"),
        (np.zeros((2, 4, 4, 2))[..., :3, :], r"got \(2, 4, 3, 2\)"),
        ([[0, 0], [1, 1], [1, np.nan], [1, 1]], "finite"),
        ([[0, 0], [1, 1], [1, np.inf], [1, 1]], "finite"),
        ([["a", "b"]] * 4, "numbers"),
        ([[0, 0], [1], [1, 1], [1, 1]], "numbers"),
        (None, "a control array must be an array of numbers, got None"),
    ],
)
def test_bad_control_arrays_are_refused(control, message):
    with pytest.raises(ValueError, match=message):
        as_control(control)


def test_exact_cusps_have_infinite_curvature_and_near_cusps_a_finite_one():
    # X' = 6 (2t - 1) ((-2, 7) + t (1, -9)) vanishes at t = 1/2
    assert max_curvature([[0, 0], [1, -9], [12, -42], [-6, -12]]) == np.inf
    # x' = 8 (t - 0.3), y' = 8e-9: curvature 1 / 1e-9^2 * ... at t = 0.3 is 8 / 8e-9^2
    near = [[0, 0], [1.6, 8e-9], [-2.4, 8e-9], [5.6, 8e-9]]
    assert max_curvature(near) == pytest.approx(8.0 / 8e-9**2, rel=1e-3)


@pytest.mark.parametrize("scale", [1e-170, 1.0, 1e119])
def test_extent_holds_at_huge_and_tiny_scales(scale):
    low, high = extent(np.array([[0.0], [0.0], [6.0], [-6.0]]) * scale)
    assert low[0] == 0.0
    assert high[0] == pytest.approx(1.5 * scale, rel=1e-14)


def test_complex_control_is_refused():
    with pytest.raises(ValueError, match="array of numbers"):
        as_control(np.zeros((4, 2), complex))


@pytest.mark.parametrize(
    "ask",
    [
        lambda control: evaluate(control, [0.5]),
        lambda control: derivative(control, [0.5]),
        lambda control: curvature(control, [0.5]),
        extent,
        to_bezier,
        from_bezier,
    ],
)
@pytest.mark.parametrize(
    ("control", "message"),
    [
        (None, "must be an array of numbers, got None"),
        (np.zeros((3, 2)), r"has shape \(\.\.\., 4, D\): start, .* got \(3, 2\)"),
        ([[0, 0], [1, 1], [1, np.nan], [1, 1]], "must be finite, got nan in it"),
        (np.full((4, 2), 1e154), r"must be at most 1e\+120 in size, got 1e\+154"),
    ],
)
def test_invalid_control_arrays_are_refused_by_every_function(ask, control, message):
    with pytest.raises(ValueError, match=message):
        ask(control)


@pytest.mark.parametrize(
    ("t", "order", "message"),
    [
        ([[0.5]], 1, r"t must have shape \(n,\), got \(1, 1\)"),
        (1.5, 1, r"parameters lie in \[0, 1\], got 1\.5"),
        (np.nan, 1, "t must be finite, got nan"),
        ([0.5, 1.5], 1, r"parameters lie in \[0, 1\], got 1\.5"),
        ([np.nan], 1, "t must be finite, got nan"),
        (None, 1, "t must be an array of numbers, got None"),
        ([0.5], -1, "order is a whole number from 0 on, got -1"),
        ([0.5], 1.0, r"order is a whole number from 0 on, got 1\.0"),
    ],
)
def test_invalid_parameters_and_orders_are_refused(t, order, message):
    with pytest.raises(ValueError, match=message):
        derivative(np.zeros((4, 2)), t, order)


def test_an_error_shows_an_array_on_one_line():
    with pytest.raises(ValueError, match="must be an array of numbers") as refused:
        as_control(np.zeros((4, 2), complex))
    assert "\n" not in str(refused.value)
