"""Arc length against closed forms, total variation and adaptive quadrature."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial import Polynomial
from scipy.integrate import quad

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import to_bezier

PROPERTY = settings(max_examples=100, deadline=None, derandomize=True)
RELATIVE = 1e-9
SCALES = (1.0, 2.0**380, 2.0**-500)  # about 1, 2e114 and 3e-151, without rounding
COORDINATES = st.floats(-20, 20).map(lambda value: round(value, 6))


def segments(least=1, most=3):
    return st.integers(least, most).flatmap(
        lambda dimension: arrays(np.float64, (4, dimension), elements=COORDINATES)
    )


def slopes(control):
    """The derivative's coordinates as polynomials in t."""
    start, end, leave, arrive = control
    square, cube = 3 * (end - start) - 2 * leave - arrive, leave + arrive - 2 * (end - start)
    return [Polynomial(row) for row in np.stack([leave, 2 * square, 3 * cube], axis=-1)]


def quadrature(control):
    """Arc length by adaptive quadrature, split where the speed is stationary."""
    coordinates = slopes(control)
    square = sum((slope * slope for slope in coordinates), Polynomial([0.0]))
    inner = square.deriv().roots().real
    joints = np.sort(np.concatenate([[0.0], inner[(inner > 0.0) & (inner < 1.0)], [1.0]]))

    def speed(t):
        return np.hypot.reduce([slope(t) for slope in coordinates])

    total = 0.0
    for a, b in itertools.pairwise(joints):
        total += quad(speed, a, b, epsabs=0.0, epsrel=1e-12, limit=200, full_output=1)[0]
    return total


def from_slopes(*coordinates):
    """The control array of the curve from the origin with these derivatives."""
    curves = [slope.integ() for slope in coordinates]
    return np.array(
        [
            [0.0] * len(curves),
            [curve(1.0) for curve in curves],
            [slope(0.0) for slope in coordinates],
            [slope(1.0) for slope in coordinates],
        ]
    )


@PROPERTY
@given(segments(), st.sampled_from(SCALES))
def test_length_agrees_with_adaptive_quadrature(control, scale):
    assert length(scale * control) == pytest.approx(
        scale * quadrature(control), rel=RELATIVE, abs=0.0
    )


@PROPERTY
@given(segments(most=1), st.sampled_from(SCALES))
def test_length_in_one_dimension_is_total_variation(control, scale):
    slope = slopes(control)[0]
    curve = slope.integ()
    turns = slope.roots()
    turns = turns[np.isreal(turns)].real
    turns = np.sort(np.concatenate([[0.0], turns[(turns > 0.0) & (turns < 1.0)], [1.0]]))
    variation = np.abs(np.diff(curve(turns))).sum()
    # a short way between far derivatives cancels in the polynomial, not in the length
    rounding = 1e-15 * np.abs(control).max()
    assert abs(length(scale * control) / scale - variation) <= RELATIVE * variation + rounding


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("part", [0.39, 0.41, 0.94, 0.949, 0.951, 1.2])
def test_length_is_accurate_up_to_the_edge_of_what_is_measured_in_one_piece(part, dimension):
    # X' = a + b s + c s^2, s in [-1, 1], comes as near to zero as the edge lets it
    stream, reach = np.random.default_rng(dimension), (2.2 + 1 / 2.2) / 2
    nodes, weights = np.polynomial.legendre.leggauss(300)
    for share in (0.0, 0.5, 1.0):
        for _ in range(40):
            a, b, c = (way / np.linalg.norm(way) for way in stream.normal(size=(3, dimension)))
            if stream.random() < 0.5:
                b, c = -a, -a
            b, c = b * part * share / reach, c * part * (1.0 - share) / reach**2
            s = nodes[:, None]
            speed = np.linalg.norm(a + b * s + c * s**2, axis=-1)
            rows = [Polynomial(row) for row in np.stack([a, b, c], axis=-1)]
            control = from_slopes(*(row(Polynomial([-1.0, 2.0])) for row in rows))
            assert length(control) == pytest.approx(0.5 * (weights @ speed), rel=RELATIVE)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("narrow", [1.0, 0.3, 0.1, 0.03, 0.01, 1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("turn", [0.5, 0.3, 0.0, 1.0, -0.003, -0.03, 1.1, 1.5])
def test_length_near_a_cusp_has_the_closed_form_of_a_parabola(narrow, turn, scale):
    control = from_slopes(Polynomial([-8.0 * turn, 8.0]), Polynomial([8.0 * narrow]))

    def primitive(s):  # of 8 sqrt(s^2 + narrow^2)
        return 4.0 * (s * np.hypot(s, narrow) + narrow**2 * np.arcsinh(s / narrow))

    expected = primitive(1.0 - turn) - primitive(-turn)
    assert length(scale * control) / scale == pytest.approx(expected, rel=RELATIVE)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("turn", [0.5, 0.25, 1 / 3, 0.7, 0.001, 0.0, 1.0])
def test_length_is_accurate_at_an_exact_cusp(turn, dimension, scale):
    # X' = (t - turn) (u + v t) with no other zero: the speed is smooth on either side
    u, v = np.array([[7.0, -4.0, 2.0], [-3.0, 11.0, 5.0]])[:, :dimension]
    nodes, weights = np.polynomial.legendre.leggauss(100)
    expected = 0.0
    for a, b in ((0.0, turn), (turn, 1.0)):
        t = 0.5 * (a + b) + 0.5 * (b - a) * nodes
        speed = np.abs(t - turn) * np.linalg.norm(u + np.outer(t, v), axis=-1)
        expected += 0.5 * (b - a) * (weights @ speed)
    coordinates = [Polynomial([-turn, 1.0]) * Polynomial(row) for row in zip(u, v, strict=True)]
    control = from_slopes(*coordinates)
    assert length(scale * control) / scale == pytest.approx(expected, rel=RELATIVE)


@pytest.mark.parametrize("scale", SCALES)
def test_a_segment_that_turns_back_counts_both_ways(scale):
    # x = 4 t (1 - t) goes one metre and returns
    control = scale * np.array([[0.0, 0.0], [0.0, 0.0], [4.0, 0.0], [-4.0, 0.0]])
    assert length(control) == pytest.approx(2.0 * scale, rel=RELATIVE, abs=0.0)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_straight_segment_is_as_long_as_its_chord(dimension, scale):
    way = scale * np.array([3.0, -4.0, 12.0])[:dimension]
    start = scale * np.array([7.0, 8.0, 9.0])[:dimension]
    chord = scale * [3.0, 5.0, 13.0][dimension - 1]
    control = [start, start + way, way, way]
    assert length(control) == pytest.approx(chord, rel=RELATIVE, abs=0.0)
    at_rest = [start, start + way, 0 * way, 0 * way]
    assert length(at_rest) == pytest.approx(chord, rel=RELATIVE, abs=0.0)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_point_has_length_zero(dimension):
    control = np.zeros((4, dimension))
    control[:2] = 1e9
    assert length(control) == 0.0


@PROPERTY
@given(segments())
def test_length_lies_between_chord_and_control_polygon(control):
    polygon = np.linalg.norm(np.diff(to_bezier(control), axis=0), axis=-1).sum()
    chord = np.linalg.norm(control[1] - control[0])
    found = length(control)
    rounding = 1e-14 * np.abs(control).max()
    assert chord * (1 - RELATIVE) - rounding <= found <= polygon * (1 + RELATIVE) + rounding


def test_batches_of_any_shape_are_measured_one_by_one():
    control = np.random.default_rng(0).normal(size=(2, 3, 4, 2))
    together = length(control)
    assert together.shape == (2, 3)
    assert together[1, 2] == length(control[1, 2])
    assert length(np.empty((0, 4, 2))).shape == (0,)


@pytest.mark.parametrize("control", [np.zeros((3, 2)), np.full((4, 2), np.nan), "line"])
def test_bad_control_arrays_are_refused(control):
    with pytest.raises(ValueError, match="control array"):
        length(control)
