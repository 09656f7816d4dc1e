"""Actions: every one in the box means a segment, and every feasible segment has one."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

from ferguson_gym.world.actions import check_action, decode, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State, advance, advance_all, fly_segment
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import ACTIONS, NO_ARRAYS, arrays, fields, laid_out, segments, vehicles

POINT = arrays(2, numbers=st.floats(-200.0, 200.0))
STEEP = arrays(2, numbers=st.floats(-66.0, 66.0) | st.sampled_from([0.0, -0.0, 1e-300, 5e-324]))


@fuzzed(
    "actions: decode, encode, decode",
    many=10000,
    action=ACTIONS,
    at=POINT,
    slope=STEEP,
    data=st.data(),
)
def test_an_action_encoded_again_is_the_action(
    action: np.ndarray, at: np.ndarray, slope: np.ndarray, data: Any
) -> None:
    action = action.astype(np.float32)
    far = np.array([1e6, 1e6])
    segment = decode(data.draw(laid_out(action.astype(float))), at, slope, far, 1.0)
    assert np.isfinite(segment).all()
    again = encode(segment, at, slope)
    assert (np.abs(again) <= 1.0).all()
    twice = decode(again, at, slope, far, 1.0)
    np.testing.assert_allclose(twice[:2], segment[:2], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(twice[2:], segment[2:], rtol=0.0, atol=1e-4)


@fuzzed(
    "actions: of anything",
    many=6000,
    action=NO_ARRAYS | arrays(4) | arrays(4).flatmap(laid_out) | arrays(2, 4),
)
def test_what_is_no_action_is_refused(action: Any) -> None:
    checked = attempt(check_action, action)
    segment = attempt(decode, action, np.zeros(2), np.ones(2), np.full(2, 100.0), 1.0)
    assert (checked is None) == (segment is None)
    if segment is not None:
        assert np.isfinite(segment).all()


@fuzzed(
    "actions: encode of anything",
    many=6000,
    segment=NO_ARRAYS | arrays(4, 2) | segments() | arrays(4, 2, numbers=st.floats(-20, 20)),
    slope=STEEP,
)
def test_a_segment_has_an_action_or_is_refused(segment: Any, slope: np.ndarray) -> None:
    found = attempt(encode, segment, np.zeros(2), slope)
    if found is not None:
        assert found.dtype == np.float32
        assert (np.abs(found) <= 1.0).all()
        again = decode(found, np.zeros(2), slope, np.full(2, 1e6), 1.0)
        wanted = np.asarray(segment, float)
        np.testing.assert_allclose(again[1], wanted[1], rtol=0.0, atol=2e-5)
        np.testing.assert_allclose(again[3], wanted[3], rtol=0.0, atol=2e-4)


@fuzzed("flight: steps", many=10000, data=st.data(), field=fields(), action=ACTIONS)
def test_a_step_has_one_outcome_whatever_the_state(
    data: Any, field: Field, action: np.ndarray
) -> None:
    vehicle: State = data.draw(vehicles(field))
    step = advance(field, vehicle, action)
    (other,) = advance_all(field, [vehicle], action[None])
    assert step.outcome is other.outcome
    assert np.isfinite(step.control).all()
    if step.outcome is Outcome.GOAL_REACHED:
        np.testing.assert_array_equal(step.state.position, field.goal)
    if not step.flown:
        assert step.state is vehicle
        return
    assert (step.inspection.slack(PAPER_LIMITS) >= -PAPER_LIMITS.tolerance).all()
    again = fly_segment(field, vehicle, step.control)
    np.testing.assert_allclose(again.control, step.control, rtol=0.0, atol=1e-4)
