"""Certified clearance and least speed against critical points, samples and closed forms."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial import Polynomial

from ferguson_gym.curves.clearance import clearance, closest, is_clear, least_speed
from ferguson_gym.curves.splines import derivative, evaluate, to_bezier

PROPERTY = settings(max_examples=150, deadline=None, derandomize=True)
SHARP = 3e-10  # of the scale, by the docstrings
GRAIN = 2e-15  # of the largest coordinate: the stated margin, and as much in the reference
SCALES = (1.0, 1e100, 1e-100)
COORDINATES = st.floats(-20, 20).map(lambda value: round(value, 6))
T = np.linspace(0.0, 1.0, 501)


@st.composite
def encounters(draw):
    """A segment and a disc, whose centre is anywhere or near the curve."""
    dimension = draw(st.integers(1, 3))
    control = draw(arrays(np.float64, (4, dimension), elements=COORDINATES))
    center = draw(arrays(np.float64, dimension, elements=COORDINATES))
    if draw(st.booleans()):
        t = draw(st.floats(0.0, 1.0))
        away = draw(st.sampled_from([0.0, 1e-14, 1e-9, 1e-4, 1e-2]))
        center = evaluate(control, [t])[0] + away * center
    return control, center, abs(draw(COORDINATES))


def scale_of(control, center):
    """Largest distance between a Bézier point and the centre."""
    return np.linalg.norm(to_bezier(control) - center, axis=-1).max()


def allowed(control, center):
    return SHARP * scale_of(control, center) + GRAIN * max(abs(control).max(), abs(center).max())


def least_norm(curve, coordinates):
    """Least norm of curve(t), from its critical points and samples, polished by zooming in."""
    square = sum((coordinate * coordinate for coordinate in coordinates), Polynomial([0.0]))
    critical = np.clip(square.deriv().roots().real, 0.0, 1.0)
    sampled = T[np.linalg.norm(curve(T), axis=-1).argmin()]
    t = np.concatenate([[0.0, 1.0, sampled], critical])
    for width in 10.0 ** -np.arange(2, 15):
        around = np.clip(t[:, None] + width * np.linspace(-1.0, 1.0, 41), 0.0, 1.0)
        norms = np.linalg.norm(curve(around.ravel()), axis=-1).reshape(around.shape)
        t = around[np.arange(len(t)), norms.argmin(axis=1)]
    return norms.min()


def distance(control, center):
    """Least distance between the curve and a point, a value that the curve attains."""
    offset = control - np.outer([1.0, 1.0, 0.0, 0.0], center)
    start, end, leave, arrive = offset
    way = end - start
    powers = [start, leave, 3 * way - 2 * leave - arrive, leave + arrive - 2 * way]
    return least_norm(lambda t: evaluate(offset, t), [Polynomial(c) for c in np.transpose(powers)])


@PROPERTY
@given(encounters(), st.sampled_from(SCALES))
def test_clearance_is_a_lower_bound_within_its_margin(encounter, scale):
    control, center, radius = encounter
    found = clearance(control * scale, [center * scale], [radius * scale]) / scale
    truth = distance(control, center) - radius
    assert truth - allowed(control, center) <= found <= truth + 1e-14 * radius


@PROPERTY
@given(encounters())
def test_no_sample_of_the_curve_is_nearer_than_its_clearance(encounter):
    control, center, radius = encounter
    samples = np.linalg.norm(evaluate(control, T) - center, axis=-1) - radius
    assert clearance(control, [center], [radius]) <= samples.min() + 1e-14 * radius


@PROPERTY
@given(encounters(), st.sampled_from(SCALES))
def test_the_parameter_returned_attains_the_clearance(encounter, scale):
    control, center, radius = encounter
    found, t = closest(control * scale, [center * scale], [radius * scale])
    attained = np.linalg.norm(evaluate(control, t)[0] - center) - radius
    assert 0.0 <= t[0] <= 1.0
    assert found[0] / scale == pytest.approx(attained, abs=allowed(control, center), rel=1e-14)


@PROPERTY
@given(encounters(), st.sampled_from([1e6, 1e9, 1e12]))
def test_clearance_survives_a_huge_translation(encounter, far):
    control, center, radius = encounter
    moved, target = control + far * np.array([[1], [1], [0], [0]]), center + far
    # the reference subtracts first, exactly, since both lie far out
    truth = distance(moved - far * np.array([[1], [1], [0], [0]]), target - far) - radius
    found = clearance(moved, [target], [radius])
    assert truth - allowed(moved, target) <= found <= truth + 1e-14 * radius


LINE = [[0, 0], [10, 0], [10, 0], [10, 0]]
AT_REST = [[0, 0], [10, 0], [0, 0], [0, 0]]
PARABOLA = [[-1, 1], [1, 1], [2, -4], [2, 4]]  # (s, s^2), s from -1 to 1
CUSP = [[1, -1], [1, 1], [-4, 6], [4, 6]]  # (s^2, s^3): a cusp at the origin
POINT = [[1, 2], [1, 2], [0, 0], [0, 0]]
LOOP = [[0, 0], [0, 0], [12, 12], [-12, 12]]  # x = 12 t (1 - t), y = x (1 - 2 t)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    ("control", "center", "radius", "expected"),
    [
        pytest.param(LINE, [5, 3], 3, 0, id="tangent"),
        pytest.param(LINE, [13, 0], 3, 0, id="touching the end"),
        pytest.param(LINE, [-4, 3], 3, 2, id="nearest to the start"),
        pytest.param(LINE, [5, 0], 4, -4, id="through the centre"),
        pytest.param(LINE, [5, 1], 100, -99, id="inside the disc"),
        pytest.param(LINE, [5, 3], 0, 3, id="radius zero"),
        pytest.param(AT_REST, [5, 3], 3, 0, id="tangent, at rest at both ends"),
        pytest.param(AT_REST, [0, 3], 3, 0, id="tangent at an end at rest"),
        pytest.param(PARABOLA, [0, -3], 2, 1, id="below the vertex"),
        pytest.param(PARABOLA, [0, 0.5], 0.5, 0, id="circle of curvature"),
        pytest.param(PARABOLA, [0, 0], 1, -1, id="centre on the vertex"),
        pytest.param(PARABOLA, [0, 1.25], 1, 0, id="touching twice"),
        pytest.param(CUSP, [-2, 0], 2, 0, id="touching a cusp"),
        pytest.param(CUSP, [0, 0], 1, -1, id="cusp in the centre"),
        pytest.param(POINT, [4, 6], 1, 4, id="point"),
        pytest.param(POINT, [1, 2], 1, -1, id="point in the centre"),
        pytest.param(LOOP, [-2, 0], 2, 0, id="loop, touching its ends"),
        pytest.param(LOOP, [5, 0], 2, 0, id="loop, touching its far end"),
        pytest.param([[0], [10], [1], [1]], [12], 1, 1, id="on a line"),
        pytest.param([[0, 0, 0], [6, 0, 0], [6, 0, 0], [6, 0, 0]], [3, 3, 4], 2, 3, id="in space"),
    ],
)
def test_clearance_of_known_contacts(control, center, radius, expected, scale):
    control, center = np.array(control, np.float64), np.array(center, np.float64)
    found, t = closest(control * scale, [center * scale], [radius * scale])
    assert expected - allowed(control, center) <= found[0] / scale <= expected
    touching = np.linalg.norm(evaluate(control, t)[0] - center) - radius
    assert touching == pytest.approx(expected, abs=allowed(control, center))


@pytest.mark.parametrize("shift", [s * 10.0**k for k in (-10, -9, -8, -6) for s in (-1, 1, 3)])
def test_the_nearer_of_two_almost_equal_contacts_counts(shift):
    # from (0, 1.25) both arms of the parabola are 1 m away
    control, center = np.array(PARABOLA, np.float64), np.array([shift, 1.25])
    truth = distance(control, center)
    assert truth == pytest.approx(1.0 - 0.75**0.5 * abs(shift), abs=1e-11)
    found = clearance(control, [center], [0.0])
    assert truth - allowed(control, center) <= found <= truth


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1.0])
@pytest.mark.parametrize("angle", [np.pi, 1.5, 0.3, 0.01, 1e-4])
def test_clearance_along_an_arc_around_the_disc(angle, gap):
    # the distance hardly changes along the whole segment: nothing singles out a nearest point
    turns = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    tangents = np.array([[0.0, 1.0], [-np.sin(angle), np.cos(angle)]])
    control = 5.0 * np.vstack([turns, 4.0 * np.tan(angle / 4.0) * tangents])
    truth = np.linalg.norm(evaluate(control, T), axis=-1).min() - (5.0 - gap)
    found = clearance(control, [[0.0, 0.0]], [5.0 - gap])
    assert truth - allowed(control, np.zeros(2)) <= found <= truth


def tangled(count, seed=0):
    """Segments among discs of which some overlap and one lies inside another."""
    stream = np.random.default_rng(seed)
    control = stream.uniform(0.0, 100.0, (count, 4, 2))
    control[:, 2:] = stream.normal(size=(count, 2, 2)) * 30.0
    centers, radii = stream.uniform(0.0, 100.0, (12, 2)), stream.uniform(1.0, 8.0, 12)
    centers[1], radii[1] = centers[0] + 0.5, 0.25
    return control, centers, radii


@pytest.mark.parametrize("seed", range(3))
def test_clearance_is_the_least_of_all_discs(seed):
    control, centers, radii = tangled(100, seed)
    each, _ = closest(control, centers, radii)
    scales = [max(scale_of(one, center) for center in centers) for one in control]
    found = clearance(control, centers, radii)
    assert (found < 0.0).any()
    assert (found > 0.0).any()
    assert (np.abs(found - each.min(axis=-1)) <= 1e-10 * np.array(scales)).all()


def test_in_a_field_the_margin_is_below_a_tenth_of_a_micrometre():
    control, centers, radii = tangled(20)
    control[:, 1] = control[:, 0] + control[:, 2] / 3.0
    control[:, 2:] *= 0.3
    found, _ = closest(control, centers, radii)
    truth = [[distance(one, center) for center in centers] for one in control]
    margin = np.array(truth) - radii - found
    assert (margin >= 0.0).all()
    assert (margin <= 1e-7).all()


@pytest.mark.parametrize("seed", range(3))
def test_is_clear_agrees_with_clearance_away_from_the_threshold(seed):
    control, centers, radii = tangled(40, seed)
    found = clearance(control, centers, radii)
    for one, clear in zip(control, found, strict=True):
        near = 1e-9 * max(scale_of(one, center) for center in centers)
        assert is_clear(one, centers, radii, least=clear - near)
        assert not is_clear(one, centers, radii, least=clear + near)
    np.testing.assert_array_equal(is_clear(control, centers, radii), found >= 0.0)


@PROPERTY
@given(encounters())
def test_is_clear_demands_the_margin_of_clearance(encounter):
    control, center, radius = encounter
    found = clearance(control, [center], [radius])
    scale, largest = scale_of(control, center), max(abs(control).max(), abs(center).max())
    assume(scale > 1e-3)
    search = 1.01e-10 * scale + GRAIN * max(largest, radius)
    assert is_clear(control, [center], [radius], least=found - search)
    assert not is_clear(control, [center], [radius], least=found + search)


@PROPERTY
@given(encounters(), st.floats(-1.0, 1.0))
def test_is_clear_is_false_wherever_a_sample_is_not_clear(encounter, shift):
    control, center, radius = encounter
    samples = np.linalg.norm(evaluate(control, T) - center, axis=-1) - radius
    # thresholds close to the truth, where a wrong yes would be easiest
    for least in (0.0, samples.min() + 1e-9 * shift, samples.min() + shift):
        if is_clear(control, [center], [radius], least):
            assert samples.min() >= least


def test_without_discs_everything_is_clear():
    control = np.zeros((3, 2, 4, 2))
    nothing = np.empty((0, 2)), np.empty(0)
    assert (clearance(control, *nothing) == np.full((3, 2), np.inf)).all()
    assert is_clear(control, *nothing, least=1e9).all()
    found, t = closest(control, *nothing)
    assert found.shape == t.shape == (3, 2, 0)


def test_batches_of_any_shape_are_searched_one_by_one():
    control, centers, radii = tangled(6)
    batch = control.reshape(2, 3, 4, 2)
    together = clearance(batch, centers, radii)
    each, t = closest(batch, centers, radii)
    speed, _ = least_speed(batch)
    yes = is_clear(batch, centers, radii)
    assert together.shape == speed.shape == yes.shape == (2, 3)
    assert each.shape == t.shape == (2, 3, 12)
    assert together[1, 2] == clearance(control[5], centers, radii)
    np.testing.assert_array_equal(each[1, 2], closest(control[5], centers, radii)[0])
    assert speed[1, 2] == least_speed(control[5])[0]
    assert clearance(np.empty((0, 4, 2)), centers, radii).shape == (0,)


@pytest.mark.parametrize("function", [clearance, closest, is_clear])
@pytest.mark.parametrize(
    ("control", "centers", "radii", "message"),
    [
        (np.zeros((3, 2)), [[0, 0]], [1], "control array"),
        (np.full((4, 2), np.nan), [[0, 0]], [1], "control array"),
        (np.zeros((4, 2)), [[0, 0, 0]], [1], r"centers must have shape \(n, 2\), got \(1, 3\)"),
        (np.zeros((4, 2)), [0, 0], [1], r"centers must have shape \(n, 2\), got \(2,\)"),
        (np.zeros((4, 2)), [[0, 0]], [1, 2], r"radii must have shape \(1,\), got \(2,\)"),
        (np.zeros((4, 2)), [[0, np.nan]], [1], "centers must be finite, got nan"),
        (np.zeros((4, 2)), [[0, 0]], [np.inf], "radii must be finite, got inf"),
        (np.zeros((4, 2)), [[0, 0]], ["wide"], "radii must be an array of numbers"),
    ],
)
def test_bad_input_is_refused(function, control, centers, radii, message):
    with pytest.raises(ValueError, match=message):
        function(control, centers, radii)


@PROPERTY
@given(encounters(), st.sampled_from(SCALES))
def test_least_speed_is_a_lower_bound_within_its_margin(encounter, scale):
    control, _, _ = encounter
    start, end, leave, arrive = control
    points = np.array([leave, 3 * (end - start) - leave - arrive, arrive])
    powers = [points[0], 2 * (points[1] - points[0]), points[0] - 2 * points[1] + points[2]]
    truth = least_norm(
        lambda t: derivative(control, t), [Polynomial(c) for c in np.transpose(powers)]
    )
    size, largest = np.linalg.norm(points, axis=-1).max(), np.abs(control).max()
    within = SHARP * size + 1e-14 * largest
    found, t = least_speed(control * scale)
    assert found >= 0.0
    assert truth - within <= found / scale <= truth
    attained = np.linalg.norm(derivative(control, [t])[0])
    assert found / scale == pytest.approx(attained, abs=within)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    ("control", "expected", "where"),
    [
        pytest.param(LINE, 10, None, id="uniform"),
        pytest.param(AT_REST, 0, None, id="at rest at both ends"),
        pytest.param(PARABOLA, 2, 0.5, id="vertex"),
        pytest.param(CUSP, 0, 0.5, id="cusp"),
        pytest.param(POINT, 0, None, id="point"),
        pytest.param([[0], [0], [4], [-4]], 0, 0.5, id="reversal"),
        pytest.param([[0, 0], [3, 2], [1, 0], [6, 8]], 1, 0.0, id="start"),
    ],
)
def test_least_speed_of_known_segments(control, expected, where, scale):
    found, t = least_speed(np.array(control) * scale)
    largest = 3 * np.abs(control).max()
    assert max(0.0, expected - SHARP * largest) <= found / scale <= expected
    if where is not None:
        assert t == pytest.approx(where, abs=1e-6)


def test_a_threshold_that_is_not_a_number_is_refused():
    with pytest.raises(ValueError, match="least must be finite, got nan"):
        is_clear([[0, 0], [9, 0], [9, 0], [9, 0]], [[4, 0]], [1], least=np.nan)


@pytest.mark.parametrize("what", ["control", "centers", "radii"])
def test_numbers_whose_squares_leave_the_range_are_refused(what):
    # the clearance of a disc that was missed came out infinite
    given = {"control": np.zeros((4, 1)), "centers": np.ones((1, 1)), "radii": np.ones(1)}
    given[what] = given[what] + 1e154
    with pytest.raises(ValueError, match=r"must be at most 1e\+120 in size, got 1e\+154"):
        clearance(**given)
