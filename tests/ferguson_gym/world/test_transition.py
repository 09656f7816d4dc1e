"""Flights: states, outcomes, and that a plan is flown as planned."""

import numpy as np
import pytest

from ferguson_gym.world.actions import encode
from ferguson_gym.world.feasibility import inspect
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import (
    State,
    advance,
    advance_all,
    fly_segment,
    initial_state,
)

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
AHEAD = np.zeros(4)
EAST = np.array([5.0, 0.0])


def heading_east(x, y=100.0, segments=0):
    return State(np.array([x, y]), EAST, segments)


def test_a_flight_departs_from_the_start_with_the_start_derivative():
    field = Field(
        name="f", obstacles=Obstacles.discs([], []), start=[3, 4], start_derivative=[1, 2]
    )
    state = initial_state(field)
    assert state.position.tolist() == [3.0, 4.0]
    assert state.derivative.tolist() == [1.0, 2.0]
    assert state.segments == 0


def test_advancing_moves_the_state_to_the_end_of_the_segment():
    state = State(np.array([40.0, 50.0]), np.array([3.0, 4.0]), segments=7)
    step = advance(OPEN, state, AHEAD)
    assert step.outcome is Outcome.FLYING
    assert step.flown
    np.testing.assert_array_equal(step.control[[0, 2]], [state.position, state.derivative])
    np.testing.assert_array_equal(step.state.position, step.control[1])
    np.testing.assert_array_equal(step.state.derivative, step.control[3])
    np.testing.assert_allclose(step.state.position, [45.4, 57.2], rtol=1e-14)
    assert step.state.segments == 8
    assert state.segments == 7


def test_a_step_reports_the_inspection_of_its_segment():
    field = Field(name="disc", obstacles=Obstacles.discs([[50.0, 30.0]], [4.0]))
    step = advance(field, initial_state(field), [0.1, -0.3, 0.2, 0.4])
    expected = inspect(step.control, field)
    for name in ("length", "clearance", "bounds_margin", "speed"):
        assert getattr(step.inspection, name) == getattr(expected, name)


@pytest.mark.parametrize(
    ("end", "derivative", "outcome"),
    [
        ([40.0, 50.0], [0.0, 0.0], Outcome.NOT_REGULAR),
        ([32.0, 50.0], [1.5, 0.0], Outcome.TOO_SHORT),
        ([40.0, 50.0], [40.0, 40.0], Outcome.TOO_LONG),
        ([40.0, 58.0], [10.0, 8.0], Outcome.LEFT_BOUNDS),
        ([42.0, 50.0], [12.0, 0.0], Outcome.COLLISION),
    ],
)
def test_a_refused_segment_is_not_flown_and_keeps_the_state(end, derivative, outcome):
    disc = Obstacles.discs([[42.0, 48.0]], [2.5])
    field = Field(name="disc", obstacles=disc, bounds=[[-10, -10], [110, 55]], goal=[100, 50])
    state = State(np.array([30.0, 50.0]), np.array([4.0, 0.0]), segments=3)
    step = fly_segment(field, state, [state.position, end, state.derivative, derivative])
    assert step.outcome is outcome
    assert not step.flown
    assert step.state is state
    np.testing.assert_allclose(step.control[1], end, rtol=0, atol=4e-6)


@pytest.mark.parametrize(
    ("x", "reached"), [(91.9, True), (90.1, True), (92.1, False), (89.9, False)]
)
def test_a_segment_that_ends_within_the_gate_ends_on_the_goal(x, reached):
    step = advance(OPEN, heading_east(x), AHEAD)
    assert step.outcome is (Outcome.GOAL_REACHED if reached else Outcome.FLYING)
    assert step.flown
    assert step.outcome.success == reached
    assert np.array_equal(step.state.position, OPEN.goal) == reached
    assert np.array_equal(step.control[1], OPEN.goal) == reached


def test_the_gate_is_that_of_the_limits():
    state = heading_east(89.0)
    wide, narrow = OPEN.with_limits(gate=2.1), OPEN.with_limits(gate=1.9)
    assert advance(wide, state, AHEAD).outcome is Outcome.GOAL_REACHED
    assert advance(narrow, state, AHEAD).outcome is Outcome.FLYING


def test_the_segment_moved_onto_the_goal_is_the_one_that_is_checked():
    # 14.5 m would be short enough, the 15.2 m to the goal are not
    state = heading_east(100.0 - 15.2)
    plan = [state.position, [99.3, 100.0], EAST, [14.5, 0.0]]
    step = fly_segment(OPEN, state, plan)
    assert step.outcome is Outcome.TOO_LONG
    np.testing.assert_array_equal(step.control[1], OPEN.goal)


@pytest.mark.parametrize(
    ("segments", "outcome"),
    [(0, Outcome.FLYING), (1, Outcome.FLYING), (2, Outcome.OUT_OF_SEGMENTS)],
)
def test_a_flight_is_over_when_its_segments_are_used_up(segments, outcome):
    step = advance(OPEN.with_limits(segments=3), heading_east(20.0, 20.0, segments), AHEAD)
    assert step.outcome is outcome
    assert step.flown
    assert not step.outcome.success
    assert step.state.segments == segments + 1


def test_forty_segments_are_flown_by_default():
    # a square of 9 m sides: ahead, turning left each time
    left = [
        np.array([1.0, 0.0]),
        np.array([0.0, 1.0]),
        np.array([-1.0, 0.0]),
        np.array([0.0, -1.0]),
    ]
    state, outcomes = State(np.array([50.0, 50.0]), 9.0 * left[0]), []
    while not outcomes or outcomes[-1] is Outcome.FLYING:
        side = len(outcomes) % 4
        end = state.position + 5.0 * (left[side] + left[(side + 1) % 4])
        plan = [state.position, end, state.derivative, 9.0 * left[(side + 1) % 4]]
        step = fly_segment(OPEN, state, plan)
        state = step.state
        outcomes.append(step.outcome)
    assert len(outcomes) == state.segments == 40
    assert outcomes[-1] is Outcome.OUT_OF_SEGMENTS


def test_the_last_segment_may_reach_the_goal():
    step = advance(OPEN, heading_east(91.0, segments=39), AHEAD)
    assert step.outcome is Outcome.GOAL_REACHED
    assert step.state.segments == 40


def test_a_last_segment_that_is_refused_is_named_for_its_fault():
    step = fly_segment(OPEN, heading_east(20.0, 20.0, 39), [[20, 20], [22, 20], [5, 0], [2, 0]])
    assert step.outcome is Outcome.TOO_SHORT
    assert step.state.segments == 39


def test_following_a_segment_is_flying_its_action_bit_for_bit():
    stream = np.random.default_rng(0)
    for _ in range(50):
        state = State(stream.uniform(30, 70, 2), stream.normal(size=2) * 10)
        end = state.position + stream.normal(size=2) * 5
        plan = [state.position, end, state.derivative, stream.normal(size=2) * 10]
        followed = fly_segment(OPEN, state, plan)
        flown = advance(OPEN, state, encode(plan, state.position, state.derivative))
        np.testing.assert_array_equal(followed.control, flown.control)
        assert followed.outcome is flown.outcome


def weaving(segments=32):
    """A chain from start to goal that weaves three times, in segments of about 5 m."""
    s = np.linspace(0.0, 1.0, segments + 1)
    ahead, aside = np.array([100.0, 100.0]), np.array([-5.0, 5.0])
    points = np.outer(s, ahead) + np.outer(np.sin(6 * np.pi * s), aside)
    slopes = ahead + np.outer(6 * np.pi * np.cos(6 * np.pi * s), aside)
    slopes = slopes / segments
    return np.stack([points[:-1], points[1:], slopes[:-1], slopes[1:]], axis=1)


def test_rounding_does_not_add_up_along_a_flight():
    chain = weaving()
    field = Field(name="open", obstacles=Obstacles.discs([], []), start_derivative=chain[0, 2])
    state = initial_state(field)
    for number, segment in enumerate(chain, start=1):
        before = state
        step = fly_segment(field, state, segment)
        state = step.state
        np.testing.assert_array_equal(step.control[[0, 2]], [before.position, before.derivative])
        assert np.linalg.norm(state.position - segment[1]) <= 4e-6
        assert np.linalg.norm(state.derivative - segment[3]) <= 3e-5
        assert step.outcome is (Outcome.FLYING if number < len(chain) else Outcome.GOAL_REACHED)
    np.testing.assert_array_equal(state.position, field.goal)


def test_a_disturbed_vehicle_still_meets_the_end_of_its_plan():
    chain = weaving()
    pushed = State(chain[4, 0] + [0.3, -0.2], chain[4, 2] + [0.5, 0.1], segments=4)
    step = fly_segment(OPEN, pushed, chain[4])
    assert step.flown
    np.testing.assert_array_equal(step.control[[0, 2]], [pushed.position, pushed.derivative])
    np.testing.assert_allclose(step.state.position, chain[4, 1], rtol=0, atol=4e-6)


@pytest.mark.parametrize("action", [[0.0, 0.0, 0.0, 1.1], [np.nan] * 4, [0.0] * 3])
def test_invalid_actions_are_refused(action):
    with pytest.raises(ValueError, match="action"):
        advance(OPEN, initial_state(OPEN), action)


def test_a_segment_that_no_action_expresses_is_refused():
    with pytest.raises(ValueError, match="ends 20 m away"):
        fly_segment(OPEN, heading_east(20.0), [[20, 100], [40, 100], [5, 0], [5, 0]])


def test_codes_and_names_of_outcomes_are_stable():
    assert [(outcome.code, outcome.label) for outcome in Outcome] == [
        (0, "flying"),
        (1, "goal_reached"),
        (2, "collision"),
        (3, "too_long"),
        (4, "too_short"),
        (5, "not_regular"),
        (6, "left_bounds"),
        (7, "out_of_segments"),
        (8, "gave_up"),
    ]


@pytest.mark.parametrize("outcome", Outcome)
def test_outcomes_are_found_by_their_code(outcome):
    assert Outcome.from_code(outcome.code) is outcome
    assert outcome.success == (outcome is Outcome.GOAL_REACHED)


@pytest.mark.parametrize("code", [-1, 9])
def test_unknown_codes_are_refused(code):
    with pytest.raises(ValueError, match=f"no outcome has code {code}; codes run from 0 to 8"):
        Outcome.from_code(code)


def test_advance_all_agrees_with_single_steps() -> None:
    field = get_field("standard/train:1")
    stream = np.random.default_rng(0)
    states, outcomes = [initial_state(field)] * 8, set()
    for _ in range(4):
        actions = stream.uniform(-0.3, 0.3, (len(states), 4)).astype(np.float32)
        together = advance_all(field, states, actions)
        for state, action, step in zip(states, actions, together, strict=True):
            alone = advance(field, state, action)
            assert step.outcome is alone.outcome
            np.testing.assert_array_equal(step.control, alone.control)
            np.testing.assert_array_equal(step.state.position, alone.state.position)
            assert step.state.segments == alone.state.segments
            for name in ("length", "clearance", "bounds_margin", "speed"):
                assert getattr(step.inspection, name) == getattr(alone.inspection, name)
        states = [step.state for step in together]
        outcomes |= {step.outcome for step in together}
    assert len(outcomes) > 1
    assert advance_all(field, [], np.empty((0, 4))) == []
    with pytest.raises(ValueError, match="an action lies in"):
        advance_all(field, states, np.full((8, 4), 1.5))
