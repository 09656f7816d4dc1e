"""Limits, and the one test of what may be flown."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats
from numpy.polynomial import Polynomial
from scipy.optimize import minimize

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.actions import STEEPEST
from ferguson_gym.world.feasibility import Inspection, inspect, is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.suites import suite_field

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
ALONG = np.array([0.8, 0.6])
STEEPEST_OF_UNIT_LENGTH = 4.39032  # greatest derivative at an end of a segment of 1 m


def straight(distance, start=(20.0, 30.0)):
    way = distance * ALONG
    return np.array([start, start + way, way, way])


def too_long(excess):
    return straight(15.0 + excess), OPEN


def too_short(excess):
    return straight(3.0 - excess), OPEN


def too_slow(excess):
    # 6 m on a line, slowest halfway
    least = 0.1 - excess
    ends = least + 3.0 * (6.0 - least)
    return np.outer([0.0, 6.0, ends, ends], ALONG), OPEN


def ends_outside(excess):
    end = np.array([110.0 + excess, 50.0])
    return np.array([end - [6.0, 0.0], end, [6.0, 0.0], [6.0, 0.0]]), OPEN


def bulges_outside(excess):
    # y = -10 - excess at t = 1/2, inside the bounds at both ends
    y = -10.0 - excess + 0.5
    return np.array([[20.0, y], [25.0, y], [5.0, -2.0], [5.0, 2.0]]), OPEN


def cuts_a_disc(excess):
    aside = np.array([-0.6, 0.8])
    center = np.array([20.0, 30.0]) + 5.0 * ALONG + (4.0 - excess) * aside
    return straight(12.0), Field(name="disc", obstacles=Obstacles.discs([center], [4.0]))


@pytest.mark.parametrize(
    ("build", "outcome"),
    [
        (too_slow, Outcome.NOT_REGULAR),
        (too_short, Outcome.TOO_SHORT),
        (too_long, Outcome.TOO_LONG),
        (ends_outside, Outcome.LEFT_BOUNDS),
        (bulges_outside, Outcome.LEFT_BOUNDS),
        (cuts_a_disc, Outcome.COLLISION),
    ],
)
@pytest.mark.parametrize("tolerance", [None, 1e-6, 1e-5, 1e-3])
def test_every_limit_allows_its_tolerance_and_no_more(build, outcome, tolerance):
    allowed = 1e-5 if tolerance is None else tolerance
    for excess, feasible in ((0.0, True), (allowed - 1e-7, True), (allowed + 1e-7, False)):
        control, field = build(excess)
        assert is_feasible(control, field, tolerance=tolerance) == feasible
        other = field.with_limits(tolerance=allowed)
        assert is_feasible(control, other) == feasible
        assert inspect(control, field).outcome(other.limits) is (
            Outcome.FLYING if feasible else outcome
        )


def test_limits_other_than_the_papers_are_obeyed():
    field = OPEN.with_limits(shortest=5.0, longest=8.0, slowest=6.0, gate=2.0)
    for distance, feasible in ((4.9, False), (5.9, False), (6.1, True), (8.1, False)):
        assert is_feasible(straight(distance), field) == feasible


@pytest.mark.parametrize(
    ("speed", "metres", "room", "clearance", "outcome"),
    [
        (0.0, 1.0, -1.0, -1.0, Outcome.NOT_REGULAR),
        (1.0, 1.0, -1.0, -1.0, Outcome.TOO_SHORT),
        (1.0, 16.0, -1.0, -1.0, Outcome.TOO_LONG),
        (1.0, 9.0, -1.0, -1.0, Outcome.LEFT_BOUNDS),
        (1.0, 9.0, 1.0, -1.0, Outcome.COLLISION),
        (1.0, 9.0, 1.0, np.inf, Outcome.FLYING),
        (np.nan, 9.0, 1.0, 1.0, Outcome.NOT_REGULAR),
        (1.0, np.nan, 1.0, 1.0, Outcome.TOO_SHORT),
        (1.0, 9.0, np.nan, 1.0, Outcome.LEFT_BOUNDS),
        (1.0, 9.0, 1.0, np.nan, Outcome.COLLISION),
    ],
)
def test_the_first_failure_in_order_is_named(speed, metres, room, clearance, outcome):
    found = Inspection(
        speed=np.array(speed),
        length=np.array(metres),
        bounds_margin=np.array(room),
        clearance=np.array(clearance),
    )
    assert found.outcome(PAPER_LIMITS) is outcome


def wild_segments(count):
    """Segments of which every kind fails in a dense field, and some are feasible."""
    stream = np.random.default_rng(0)
    start = stream.uniform(-9.0, 109.0, (count, 2))
    end = start + stream.normal(size=(count, 2)) * 5.0
    slopes = stream.normal(size=(2, count, 2)) * stream.choice([0.3, 5.0, 15.0], (1, count, 1))
    return np.stack([start, end, *slopes], axis=1)


def test_feasible_is_what_inspection_calls_flying():
    field, control = suite_field("dense", "train", 0), wild_segments(400)
    outcomes = [inspect(one, field).outcome(field.limits) for one in control]
    assert set(outcomes) == {
        Outcome.FLYING,
        Outcome.NOT_REGULAR,
        Outcome.TOO_SHORT,
        Outcome.TOO_LONG,
        Outcome.LEFT_BOUNDS,
        Outcome.COLLISION,
    }
    flying = [outcome is Outcome.FLYING for outcome in outcomes]
    np.testing.assert_array_equal(is_feasible(control, field), flying)


def test_no_sample_contradicts_a_feasible_segment():
    field, control = suite_field("dense", "train", 0), wild_segments(400)
    feasible = control[is_feasible(control, field)]
    points = evaluate(feasible, np.linspace(0.0, 1.0, 1001))
    chords = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    assert len(feasible) > 20
    assert (field.obstacles.signed_distance(points) >= -1e-5).all()
    assert (points >= field.bounds[0] - 1e-5).all()
    assert (points <= field.bounds[1] + 1e-5).all()
    assert (chords.sum(axis=1) <= 15.0 + 1e-5).all()
    assert (chords.sum(axis=1) >= 3.0 - 1e-3).all()
    assert (1000.0 * chords >= 0.1 - 1e-5).all()


def test_a_cut_between_the_papers_samples_is_refused():
    # the disc reaches 6.7 mm across the line, between two of 30 samples half a metre apart
    samples = evaluate(straight(15.0), np.linspace(0.0, 1.0, 30))
    middle = 0.5 * (samples[14] + samples[15])
    disc = Obstacles.discs([middle + (9.0 - 0.2**2) ** 0.5 * np.array([-0.6, 0.8])], [3.0])
    field = Field(name="between", obstacles=disc)
    assert disc.signed_distance(samples).min() > 0.0
    found = inspect(straight(15.0), field)
    assert found.outcome(PAPER_LIMITS) is Outcome.COLLISION
    assert found.clearance == pytest.approx(8.96**0.5 - 3.0, abs=1e-7)


def test_inspection_finds_known_values():
    field = Field(
        name="disc", obstacles=Obstacles.discs([[20.0, 40.0]], [3.0]), bounds=[-15.0, 105.0]
    )
    found = inspect([[20.0, 30.0], [29.0, 30.0], [9.0, 0.0], [9.0, 0.0]], field)
    assert found.length == pytest.approx(9.0, rel=1e-9)
    assert found.clearance == pytest.approx(7.0, abs=1e-7)
    assert 35.0 - 1e-10 < found.bounds_margin < 35.0
    assert found.speed == pytest.approx(9.0, abs=1e-7)
    np.testing.assert_allclose(
        found.slack(PAPER_LIMITS), [8.9, 6.0, 6.0, 35.0, 7.0], rtol=0, atol=1e-7
    )


def test_the_bounds_margin_is_measured_to_the_nearest_side():
    bounds = [[-1.0, -2.0], [104.0, 108.0]]
    field = Field(name="box", obstacles=Obstacles.discs([], []), bounds=bounds)
    for start, room in (([50, 0], 2.0), ([0, 50], 1.0), ([98, 50], 3.0), ([50, 104], 4.0)):
        control = np.array([start, np.add(start, [3, 0]), [3, 0], [3, 0]])
        assert room - 1e-10 < inspect(control, field).bounds_margin < room
        assert inspect(control, field).clearance == np.inf


def test_batches_of_any_shape_are_inspected_one_by_one():
    field, control = suite_field("dense", "train", 0), wild_segments(6)
    batch = control.reshape(2, 3, 4, 2)
    found = inspect(batch, field)
    assert found.slack(PAPER_LIMITS).shape == (2, 3, 5)
    assert is_feasible(batch, field).shape == (2, 3)
    alone = inspect(control[5], field).slack(PAPER_LIMITS)
    np.testing.assert_allclose(found.slack(PAPER_LIMITS)[1, 2], alone, rtol=1e-14)


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (np.zeros((4, 3)), "field open has 2 dimensions, the control array 3"),
        (np.zeros((3, 2)), "control array"),
        (np.full((4, 2), np.inf), "control array must be finite"),
    ],
)
def test_bad_control_arrays_are_refused(control, message):
    with pytest.raises(ValueError, match=message):
        inspect(control, OPEN)


def integral_of_absolute(polynomial):
    roots = polynomial.roots()
    inner = roots[np.isreal(roots)].real
    joints = np.sort(np.concatenate([[0.0], inner[(inner > 0.0) & (inner < 1.0)], [1.0]]))
    return np.abs(np.diff(polynomial.integ()(joints))).sum()


def test_the_steepest_end_of_a_segment_of_given_length():
    # the derivative along its own direction at the start is a quadratic polynomial; the
    # least integral of its absolute value is a convex problem
    found = minimize(
        lambda free: integral_of_absolute(Polynomial([1.0, *free])),
        [-4.0, 4.0],
        method="Nelder-Mead",
        options={"xatol": 1e-10, "fatol": 1e-14},
    )
    assert 1.0 / found.fun == pytest.approx(STEEPEST_OF_UNIT_LENGTH, abs=1e-5)
    longest = PAPER_LIMITS.longest + PAPER_LIMITS.tolerance
    assert longest / found.fun < STEEPEST
    # the segment itself goes forth and back on a line
    slope = Polynomial([1.0, *found.x]) / found.fun
    control = [[0.0], [slope.integ()(1.0)], [slope(0.0)], [slope(1.0)]]
    assert length(control) == pytest.approx(1.0, rel=1e-9)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(arrays(np.float64, (4, 2), elements=floats(-20, 20).map(lambda value: round(value, 6))))
def test_no_segment_has_a_steeper_end(control):
    slopes = np.linalg.norm(control[2:], axis=-1)
    assert slopes.max() <= STEEPEST_OF_UNIT_LENGTH * length(control) + 1e-12


def test_limits_are_those_of_the_design():
    design = Limits(shortest=3.0, longest=15.0, slowest=0.1, gate=1.0, tolerance=1e-5, segments=40)
    assert design == PAPER_LIMITS


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shortest": 0.0}, "need 0 < shortest < longest, got 0.0 m and 15.0 m"),
        ({"shortest": 15.0}, "need 0 < shortest < longest, got 15.0 m and 15.0 m"),
        ({"longest": 2.0, "shortest": 3.0}, "need 0 < shortest < longest, got 3.0 m and 2.0 m"),
        ({"longest": -2.0}, "need 0 < shortest < longest, got -0.4 m and -2.0 m"),
        ({"tolerance": -1e-9}, "need 0 <= tolerance < slowest, got -1e-09 m and 0.1 m"),
        ({"slowest": 1e-5}, "need 0 <= tolerance < slowest, got 1e-05 m and 1e-05 m"),
        ({"gate": 3.0}, "need 0 <= gate < shortest, got 3.0 m and 3.0 m"),
        ({"gate": -1.0}, "need 0 <= gate < shortest, got -1.0 m and 3.0 m"),
        ({"segments": 0}, "at least 1 segment, got 0"),
    ],
)
def test_limits_that_contradict_each_other_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Limits(**options)


@pytest.mark.parametrize(
    "name", ["shortest", "longest", "slowest", "gate", "tolerance", "segments"]
)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_limits_that_are_not_finite_are_refused(name, value):
    with pytest.raises(ValueError, match=f"limit {name} must be finite, got {value}"):
        Limits(**{name: value})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gate": "1"}, "limit gate must be a number, got '1'"),
        ({"longest": "15"}, "limit longest must be a number, got '15'"),
        ({"segments": 1.5}, "limit segments must be a whole number, got 1.5"),
        ({"longest": 10**400}, "limit longest must be a number, got 1000"),
    ],
)
def test_limits_that_are_not_numbers_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Limits(**options)
