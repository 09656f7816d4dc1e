"""Points along a path: even in arc length, with the right directions and curvatures."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ferguson_gym.curves import Path, length
from ferguson_gym.curves.sampling import MOST
from ferguson_gym.curves.splines import subdivide

KNOT = arrays(np.float64, (2, 2), elements=st.floats(-20, 20).map(lambda x: round(x, 3)))
QUARTER = 4.0 * (math.sqrt(2.0) - 1.0)
"""Length of the end derivatives of the cubic that is nearest to a quarter of the unit circle."""


def circle(radius, turn=1.0):
    """Four quarters of a circle, from (radius, 0): to the left, or to the right if turn is -1."""
    angles = turn * np.arange(5) * np.pi / 2.0
    points = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    slopes = turn * QUARTER * np.column_stack([-points[:, 1], points[:, 0]])
    return Path(np.stack([points[:-1], points[1:], slopes[:-1], slopes[1:]], axis=1))


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_circle_has_even_points_tangents_and_signed_curvature(turn):
    path = circle(8.0, turn)
    samples = path.sample(number=101)
    assert len(samples) == 101
    angles = turn * np.linspace(0.0, 2.0 * np.pi, 101)
    exact = 8.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    # the Bézier curve leaves the circle by 2.7e-4 of the radius
    np.testing.assert_allclose(samples.position, exact, atol=3e-3)
    turned = np.angle(np.exp(1j * (samples.heading - angles - turn * np.pi / 2.0)))
    np.testing.assert_allclose(turned, 0.0, atol=2e-3)
    np.testing.assert_allclose(samples.curvature, turn / 8.0, rtol=0.03)
    np.testing.assert_allclose(samples.distance, np.linspace(0.0, path.length, 101))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.lists(KNOT, min_size=2, max_size=5), st.integers(2, 40))
def test_the_way_between_neighbours_is_the_same_along_any_path(knots, number):
    points, slopes = np.array(knots).transpose(1, 0, 2)
    path = Path(np.stack([points[:-1], points[1:], slopes[:-1], slopes[1:]], axis=1))
    if path.length < 1e-3:
        return
    samples = path.sample(number=number)
    np.testing.assert_array_equal(samples.position[[0, -1]], [points[0], points[-1]])
    np.testing.assert_allclose(np.diff(samples.distance), path.length / (number - 1))
    ends = np.cumsum(length(path.control))
    for way, position in zip(samples.distance[1:-1], samples.position[1:-1], strict=True):
        k = min(int(np.searchsorted(ends, way)), len(ends) - 1)
        before = ends[k] - length(path.control)[k]
        # of the points with this way behind them there is one, to be found by bisection
        low, high = 0.0, 1.0
        for _ in range(50):
            t = 0.5 * (low + high)
            low, high = (
                (t, high) if length(subdivide(path.control[k], t)[0]) < way - before else (low, t)
            )
        expected = subdivide(path.control[k], 0.5 * (low + high))[0][1]
        np.testing.assert_allclose(position, expected, atol=1e-7 * path.length)
    np.testing.assert_allclose(np.linalg.norm(samples.direction, axis=1), 1.0)


def test_a_spacing_is_an_upper_limit_and_both_ends_are_included():
    line = Path([[[0, 0], [9, 0], [9, 0], [9, 0]]])
    for spacing in (3.0, 4.0):
        np.testing.assert_allclose(line.sample(spacing=spacing).distance, [0.0, 3.0, 6.0, 9.0])
    np.testing.assert_allclose(line.sample(spacing=100.0).distance, [0.0, 9.0])
    path = circle(3.0)
    for parts in (1, 7, 100):  # of a length that is not a round number
        assert len(path.sample(spacing=path.length / parts)) == parts + 1


def test_where_a_vehicle_stands_still_its_direction_is_that_of_the_path():
    line = Path([[[0, 0], [3, 4], [0, 0], [0, 0]]])
    samples = line.sample(number=5)
    np.testing.assert_allclose(samples.direction, np.full((5, 2), (0.6, 0.8)))
    np.testing.assert_allclose(samples.position[2], (1.5, 2.0))


@pytest.mark.parametrize("dimension", [1, 3])
def test_paths_that_are_not_planar_have_directions_but_no_heading(dimension):
    row = np.arange(1.0, dimension + 1.0)
    samples = Path([[0.0 * row, row, row, row]]).sample(number=3)
    np.testing.assert_allclose(samples.direction, np.tile(row / np.linalg.norm(row), (3, 1)))
    np.testing.assert_allclose(samples.curvature, 0.0)
    with pytest.raises(ValueError, match=f"this one has {dimension} dimensions: use direction"):
        _ = samples.heading


def test_samples_do_not_change():
    samples = circle(1.0).sample(number=5)
    with pytest.raises(dataclasses.FrozenInstanceError):
        samples.position = np.zeros((5, 2))
    with pytest.raises(ValueError, match="read-only"):
        samples.position[0] = 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give either spacing in metres or number of points"),
        ({"spacing": 1.0, "number": 5}, "give either spacing in metres or number of points"),
        ({"spacing": 0.0}, r"spacing must be above 0 m and finite, got 0\.0"),
        ({"spacing": math.nan}, "spacing must be above 0 m and finite, got nan"),
        ({"spacing": 1e-9}, rf"a spacing of 1e-09 m gives more than {MOST} points on a path of"),
        ({"number": 1}, rf"a path is sampled at 2 to {MOST} points, got 1"),
        ({"number": MOST + 1}, f"points, got {MOST + 1}"),
    ],
)
def test_wrong_numbers_of_points_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        circle(10.0).sample(**options)


def test_a_path_without_a_length_is_refused():
    with pytest.raises(ValueError, match="a path of length 0 has no directions"):
        Path(np.ones((1, 4, 2)) * [[1], [1], [0], [0]]).sample(number=3)
