"""Segments as actions and back."""

import cmath

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ferguson_gym.world.actions import REACH, STEEPEST, decode, encode, encode_ends
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles

PROPERTY = settings(max_examples=200, deadline=None, derandomize=True)
FAR = np.array([1e6, 1e6])  # a goal that nothing snaps to
END_ERROR, DERIVATIVE_ERROR = 4e-6, 3e-5  # by the docstring of encode
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))

ACTIONS = arrays(np.float32, 4, elements=st.floats(-1, 1, width=32, allow_subnormal=False))
POSITIONS = arrays(np.float64, 2, elements=st.floats(-10, 110))
ANGLES = st.floats(-np.pi, np.pi)


def turned(vector, angle):
    value = complex(*vector) * cmath.exp(1j * angle)
    return np.array([value.real, value.imag])


@st.composite
def derivatives(draw):
    return turned([draw(st.floats(0.1, 66.0)), 0.0], draw(ANGLES))


@PROPERTY
@given(ACTIONS, POSITIONS, derivatives())
def test_encoding_a_decoded_action_gives_it_back(action, position, derivative):
    segment = decode(action, position, derivative, FAR, gate=1.0)
    again = encode(segment, position, derivative)
    assert again.dtype == np.float32
    # float32 numbers above 1e-6 lie farther apart than this
    np.testing.assert_allclose(again, action, rtol=0, atol=2e-14)


@PROPERTY
@given(
    POSITIONS,
    derivatives(),
    st.floats(0.0, REACH),
    ANGLES,
    st.tuples(st.floats(0.0, STEEPEST), ANGLES).map(
        lambda polar: turned([polar[0], 0.0], polar[1])
    ),
)
def test_decoding_an_encoded_segment_is_accurate(position, derivative, distance, angle, slope):
    forward = cmath.phase(complex(*derivative))
    end = position + turned([distance, 0.0], angle)
    segment = np.array([position, end, derivative, turned(slope, forward)])
    action = encode(segment, position, derivative)
    assert (np.abs(action) <= 1.0).all()
    again = decode(action, position, derivative, FAR, gate=1.0)
    np.testing.assert_array_equal(again[[0, 2]], segment[[0, 2]])
    assert np.linalg.norm(again[1] - end) <= END_ERROR
    assert np.linalg.norm(again[3] - segment[3]) <= DERIVATIVE_ERROR


@pytest.mark.parametrize("distance", [0.0, 3.0, 9.0, 15.0, 15.0 + 1e-5, REACH])
@pytest.mark.parametrize("direction", np.linspace(-np.pi, np.pi, 9))
def test_accuracy_holds_at_the_edges_of_what_can_be_expressed(distance, direction):
    position, derivative = np.zeros(2), np.array([5.0, 0.0])
    for steep in (0.0, 9.0, 65.76, STEEPEST):
        for way in np.linspace(-np.pi, np.pi, 9):
            end = turned([distance, 0.0], direction)
            segment = np.array([position, end, derivative, turned([steep, 0.0], way)])
            action = encode(segment, position, derivative)
            again = decode(action, position, derivative, FAR, gate=1.0)
            assert np.linalg.norm(again[1] - end) <= END_ERROR
            assert np.linalg.norm(again[3] - segment[3]) <= DERIVATIVE_ERROR


@PROPERTY
@given(POSITIONS, derivatives())
def test_the_zero_action_is_nine_metres_straight_ahead(position, derivative):
    segment = decode(np.zeros(4), position, derivative, FAR, gate=1.0)
    ahead = 9.0 * derivative / np.linalg.norm(derivative)
    expected = [position, position + ahead, derivative, ahead]
    np.testing.assert_allclose(segment, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("action", "end", "slope"),
    [
        ([1, 0, 0, 0], [REACH, 0], [9, 0]),
        ([-1, 0, 0, 0], [-REACH, 0], [9, 0]),
        ([0, 0, 1, 0], [9, 0], [STEEPEST, 0]),
        ([0, 0, -1, 1], [9, 0], [-STEEPEST, STEEPEST]),
        ([0, 0, 0, -1], [9, 0], [9, -STEEPEST]),
    ],
)
def test_the_ends_of_the_action_space(action, end, slope):
    # the vehicle flies along the second axis: forward is (0, 1), left is (-1, 0)
    segment = decode(action, np.array([2.0, 3.0]), np.array([0.0, 5.0]), FAR, gate=1.0)
    np.testing.assert_allclose(segment[1], [2.0 - end[1], 3.0 + end[0]], rtol=0, atol=1e-11)
    np.testing.assert_allclose(segment[3], [-slope[1], slope[0]], rtol=0, atol=1e-11)


@PROPERTY
@given(ACTIONS)
def test_the_second_and_fourth_entry_mean_left(action):
    mirrored = action * np.array([1, -1, 1, -1], np.float32)
    origin, forward = np.zeros(2), np.array([5.0, 0.0])
    one = decode(action, origin, forward, FAR, gate=1.0)
    other = decode(mirrored, origin, forward, FAR, gate=1.0)
    np.testing.assert_allclose(other, one * [1.0, -1.0], rtol=0, atol=1e-12)
    assert (one[1, 1] >= 0.0) == (action[1] >= 0.0)


@PROPERTY
@given(ACTIONS, POSITIONS, derivatives(), ANGLES)
def test_a_turned_vehicle_flies_the_turned_segment(action, position, derivative, angle):
    segment = decode(action, position, derivative, FAR, gate=1.0)
    other = decode(action, turned(position, angle), turned(derivative, angle), FAR, gate=1.0)
    np.testing.assert_allclose(other, [turned(row, angle) for row in segment], rtol=0, atol=1e-10)


@PROPERTY
@given(ACTIONS, POSITIONS, derivatives(), st.floats(0.0, 2.0), ANGLES)
def test_an_end_within_the_gate_is_moved_onto_the_goal(action, position, derivative, off, angle):
    free = decode(action, position, derivative, FAR, gate=1.0)
    goal = free[1] + turned([off, 0.0], angle)
    assume(abs(off - 1.0) > 1e-9)
    segment = decode(action, position, derivative, goal, gate=1.0)
    np.testing.assert_array_equal(segment[1], goal if off < 1.0 else free[1])
    np.testing.assert_array_equal(segment[[0, 2, 3]], free[[0, 2, 3]])


def test_the_gate_itself_belongs_to_the_goal():
    end = decode(np.zeros(4), np.zeros(2), np.array([5.0, 0.0]), FAR, gate=1.0)[1]
    goal = end + np.array([1.0, 0.0])
    for gate, expected in ((1.0, goal), (0.999, end), (0.0, end)):
        segment = decode(np.zeros(4), np.zeros(2), np.array([5.0, 0.0]), goal, gate)
        np.testing.assert_array_equal(segment[1], expected)


@pytest.mark.parametrize("left", [-0.3, -0.1, 0.02, 0.1, 0.3])
def test_end_points_alone_fly_arcs(left):
    # an arc that leaves forward and ends at angle a arrives at angle 2 a
    segment = decode([0.0, left, 0.0, 0.0], np.zeros(2), np.array([9.0, 0.0]), FAR, gate=1.0)
    bearing = cmath.phase(complex(*segment[1]))
    assert cmath.phase(complex(*segment[3])) == pytest.approx(2.0 * bearing, rel=0.1)
    assert np.linalg.norm(segment[3]) == pytest.approx(9.0)


def test_every_feasible_segment_can_be_expressed():
    stream = np.random.default_rng(0)
    count = 3000
    start = stream.uniform(0.0, 100.0, (count, 2))
    way = stream.normal(size=(count, 2))
    distance = stream.uniform(0.0, 15.0, (count, 1))
    end = start + way / np.linalg.norm(way, axis=-1, keepdims=True) * distance
    slopes = stream.normal(size=(2, count, 2)) * stream.uniform(0.0, 30.0, (2, count, 1))
    control = np.stack([start, end, *slopes], axis=1)
    feasible = control[is_feasible(control, OPEN)]
    assert len(feasible) > 500
    for segment in feasible:
        position, derivative = segment[0], segment[2]
        action = encode(segment, position, derivative)
        again = decode(action, position, derivative, FAR, gate=1.0)
        np.testing.assert_allclose(again, segment, rtol=0, atol=DERIVATIVE_ERROR)


def test_the_longest_feasible_segment_can_be_expressed():
    longest = PAPER_LIMITS.longest + 0.99 * PAPER_LIMITS.tolerance
    for angle in np.linspace(-np.pi, np.pi, 100):
        way = turned([longest, 0.0], angle)
        segment = np.array([[50.0, 50.0], way + 50.0, way, way])
        assert is_feasible(segment, OPEN)
        action = encode(segment, segment[0], segment[2])
        again = decode(action, segment[0], segment[2], FAR, gate=1.0)
        assert np.linalg.norm(again[1] - segment[1]) <= END_ERROR


def test_only_the_end_of_a_segment_is_encoded():
    position, derivative = np.array([1.0, 2.0]), np.array([3.0, 1.0])
    planned = np.array([[1.3, 1.8], [6.0, 7.0], [2.0, 2.0], [4.0, -1.0]])
    action = encode(planned, position, derivative)
    flown = decode(action, position, derivative, FAR, gate=1.0)
    np.testing.assert_array_equal(flown[[0, 2]], [position, derivative])
    np.testing.assert_allclose(flown[[1, 3]], planned[[1, 3]], rtol=0, atol=END_ERROR)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.0, 0.0, 0.0, 1.0000001], r"lies in \[-1, 1\], got \[0.0, 0.0, 0.0, 1.0000001\]"),
        ([-1.5, 0.0, 0.0, 0.0], r"lies in \[-1, 1\], got \[-1.5"),
        ([0.0, 2.0, 0.0, 0.0], r"lies in \[-1, 1\]"),
        ([0.0, 0.0, -7.0, 0.0], r"lies in \[-1, 1\]"),
        ([0.0, 0.0, np.nan, 0.0], "action must be finite, got nan"),
        ([np.inf, 0.0, 0.0, 0.0], "action must be finite, got inf"),
        ([0.0, 0.0, 0.0], r"action must have shape \(4,\), got \(3,\)"),
        ([[0.0, 0.0, 0.0, 0.0]], r"action must have shape \(4,\), got \(1, 4\)"),
        (0.0, r"action must have shape \(4,\), got \(\)"),
        ("ahead", "action must be an array of numbers"),
    ],
)
def test_invalid_actions_are_refused(action, message):
    with pytest.raises(ValueError, match=message):
        decode(action, np.zeros(2), np.array([5.0, 0.0]), FAR, gate=1.0)


@pytest.mark.parametrize(
    ("end", "slope", "message"),
    [
        ([15.002, 0.0], [5.0, 0.0], "ends 15.002 m away with derivative 5 m per unit t"),
        ([0.0, -30.0], [5.0, 0.0], "ends 30 m away"),
        ([-15.01, 0.0], [5.0, 0.0], "ends 15.01 m away"),
        ([9.0, 0.0], [66.1, 0.0], "with derivative 66.1 m per unit t"),
        ([9.0, 0.0], [-66.1, 0.0], "with derivative 66.1 m per unit t"),
        ([9.0, 0.0], [0.0, 66.1], "with derivative 66.1 m per unit t"),
    ],
)
def test_a_segment_out_of_reach_is_refused(end, slope, message):
    segment = [[0.0, 0.0], end, [5.0, 0.0], slope]
    with pytest.raises(ValueError, match=message):
        encode(segment, np.zeros(2), np.array([5.0, 0.0]))


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        (np.zeros((3, 2)), r"segment must have shape \(4, 2\), got \(3, 2\)"),
        (np.zeros((4, 3)), r"segment must have shape \(4, 2\), got \(4, 3\)"),
        (np.full((4, 2), np.nan), "segment must be finite, got nan"),
    ],
)
def test_segments_that_are_not_planar_are_refused(segment, message):
    with pytest.raises(ValueError, match=message):
        encode(segment, np.zeros(2), np.array([5.0, 0.0]))


@pytest.mark.parametrize("end", [REACH / (9.0 / REACH), 25.0, 1e6])
@pytest.mark.parametrize("slope", [9.0, 3268.0, 1e9])
def test_segments_beyond_the_poles_of_the_encoding_are_refused(end, slope):
    with pytest.raises(ValueError, match="no action reaches"):
        encode([[0, 0], [end, 0], [9, 0], [slope, 0]], np.zeros(2), np.array([9.0, 0.0]))


@pytest.mark.parametrize("size", [1e-140, 1e-161, 5e-324])
def test_a_derivative_whose_square_underflows_has_a_heading(size):
    # the segment was 36 mm short, and some had no action
    slow = np.array([0.0, size])
    segment = decode([0.0, 0.0, 0.0, 0.0], np.zeros(2), slow, FAR, 1.0)
    np.testing.assert_allclose(segment[1], [0.0, 9.0], atol=1e-12)
    np.testing.assert_array_equal(encode(segment, np.zeros(2), slow), np.zeros(4, np.float32))


@pytest.mark.parametrize(
    ("at", "slope", "message"),
    [
        (np.zeros(3), np.ones(2), r"position must have shape \(2,\), got \(3,\)"),
        ([0.0, np.nan], np.ones(2), "position must be finite, got nan"),
        (None, np.ones(2), "position must be an array of numbers, got None"),
        (np.zeros(2), [np.inf, 0.0], "derivative must be finite, got inf"),
    ],
)
def test_invalid_positions_and_derivatives_are_refused(at, slope, message):
    with pytest.raises(ValueError, match=message):
        decode(np.zeros(4), at, slope, FAR, 1.0)
    with pytest.raises(ValueError, match=message):
        encode(np.ones((4, 2)), at, slope)


FAR = np.full(2, 1e6)


def test_many_ends_are_encoded_as_each_alone():
    stream = np.random.default_rng(0)
    many = 500
    positions, derivatives = stream.normal(0.0, 30.0, (many, 2)), stream.normal(0.0, 8.0, (many, 2))
    units = stream.choice([0.3, 1.0, 20.0], many)
    ends = units[:, None] * stream.normal(0.0, 7.0, (many, 2))
    slopes = units[:, None] * stream.normal(0.0, 20.0, (many, 2))
    actions, inside = encode_ends(ends, slopes, derivatives, units)
    for k in range(many):
        here, ahead = positions[k], derivatives[k]
        segment = [here, here + ends[k], ahead, slopes[k]]
        if inside[k]:
            alone = encode(segment, here, ahead, float(units[k]))
            np.testing.assert_allclose(actions[k], alone, atol=2e-6)
        else:
            with pytest.raises(ValueError, match="no action reaches"):
                encode(segment, here, ahead, float(units[k]))
    assert 0.5 < inside.mean() < 1.0
