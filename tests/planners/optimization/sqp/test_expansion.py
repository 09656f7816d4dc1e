"""A chain to second order, against independent arithmetic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.curves.arc_length import length as certified_length
from ferguson_gym.curves.clearance import least_speed
from ferguson_gym.curves.splines import derivative, evaluate
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.optimization.quadrature import bending, lengths
from planners.optimization.sqp.contacts import HIGH, LOW, NEAR, SPEED
from planners.optimization.window import Window, WindowSettings, horizon_window
from tests.support.expanded_windows import (
    NUMBERS,
    REACH,
    clearances,
    expanded,
    ordinary,
    windows,
)
from tests.support.random_windows import Case


@given(windows)
@settings(deadline=None, max_examples=200, derandomize=True)
def test_lengths_bending_and_points_are_those_of_the_chain(
    drawn: tuple[Window, np.ndarray],
) -> None:
    window, x = drawn
    control = window.chain.control(x)
    here = expanded(window, x, bending_weight=0.01)
    np.testing.assert_array_equal(here.out.control, control)
    assert here.length == pytest.approx(here.out.length.sum(), rel=1e-14)
    # sixteen nodes err by centimetres at a near-cusp, where certification corrects them
    exact, near_cusp = certified_length(control), least_speed(control)[0] < 1.0
    assert (abs(here.out.length - exact) <= 2e-3 * exact + 0.05 * near_cusp).all()
    t = np.linspace(0.0, 1.0, 1001)
    square = np.sum(derivative(control, t, 2) ** 2, axis=-1)
    assert here.bent == pytest.approx(0.01 * np.trapezoid(square, t).sum(), rel=1e-5)
    assert here.bent == pytest.approx(0.01 * float(bending(control)), rel=1e-12)


def test_lengths_of_smooth_chains_agree_with_certified_ones() -> None:
    smooth = 0
    for seed in range(50):
        window, x = ordinary(seed)
        control = window.chain.control(x)
        speed = np.linalg.norm(derivative(control, np.linspace(0.0, 1.0, 101)), axis=-1)
        even = speed.min(axis=1) > 0.6 * speed.max(axis=1)
        smooth += int(even.sum())
        got = expanded(window, x).out.length[even]
        np.testing.assert_allclose(got, certified_length(control)[even], rtol=1e-8)
        np.testing.assert_allclose(got, lengths(control)[even], rtol=1e-8)
    assert smooth > 10


def test_a_correction_is_added_to_the_length_alone() -> None:
    window, x = ordinary(0)
    correction = np.array([0.5, 0.0, -0.25])
    plain, corrected = expanded(window, x), expanded(window, x, correction=correction)
    np.testing.assert_allclose(corrected.out.length - plain.out.length, correction, atol=1e-12)
    assert corrected.length == pytest.approx(plain.length + 0.25)
    np.testing.assert_array_equal(corrected.out.length_slope, plain.out.length_slope)


@given(windows)
@settings(deadline=None, max_examples=200, derandomize=True)
def test_contacts_have_their_clearance_and_are_within_reach(
    drawn: tuple[Window, np.ndarray],
) -> None:
    here = expanded(*drawn)
    contact = here.contact
    np.testing.assert_allclose(contact["clearance"], clearances(here, contact), atol=1e-9)
    assert (contact["clearance"] < REACH).all()
    assert ((contact["t"] >= 0.0) & (contact["t"] <= 1.0)).all()
    np.testing.assert_allclose(np.linalg.norm(contact["normal"], axis=1), 1.0, rtol=1e-12)
    pinned = contact[(contact["what"] >= 0) & (contact["drift"] == 0.0)]
    last = (pinned["segment"] == len(here.out.length) - 1) & (pinned["t"] == 1.0)
    assert (last | (pinned["clearance"] < NEAR)).all()


@given(windows)
@settings(deadline=None, max_examples=200, derandomize=True)
def test_a_contact_that_moves_is_a_local_minimum(drawn: tuple[Window, np.ndarray]) -> None:
    here = expanded(*drawn)
    moving = here.contact[here.contact["drift"] > 0.0]
    at, step = clearances(here, moving), 1e-4
    for side in (-step, step):
        beside = moving.copy()
        beside["t"] += side
        inside = (beside["t"] > 0.0) & (beside["t"] < 1.0)
        assert (clearances(here, beside) >= at - 1e-9)[inside].all()


@given(seed=st.integers(0, 2**32 - 1), segments=st.integers(1, 4))
@settings(deadline=None, max_examples=300, derandomize=True)
def test_no_nearest_point_within_reach_is_missed(seed: int, segments: int) -> None:
    window, x = ordinary(seed, segments)
    here = expanded(window, x)
    control, field = here.out.control, window.field
    t = np.linspace(0.0, 1.0, 2001)
    points = evaluate(control, t)
    near = dict.fromkeys(here.contact["what"], np.inf)
    for contact in here.contact:
        near[contact["what"]] = min(near[contact["what"]], contact["clearance"])
    # the chain's start is fixed: neither it nor a dip right behind it need be a contact
    behind = len(t) // 16
    sampled = window.obstacles.signed_distance(points).reshape(-1, len(window.obstacles))
    for disc in range(len(window.obstacles)):
        nearest = sampled[:, disc].argmin()
        if nearest > behind and sampled[nearest, disc] < REACH:
            assert near[disc] <= sampled[nearest, disc] + 1e-9
    contact, speed = here.contact, np.linalg.norm(derivative(control, t), axis=-1)
    for segment, slowest in enumerate(speed.argmin(axis=1)):
        room = speed[segment, slowest] - PAPER_LIMITS.slowest
        if room < REACH and (slowest > behind or segment > slowest == 0):
            same = (contact["what"] == SPEED) & (contact["segment"] == segment)
            assert contact["clearance"][same].min() <= room + 1e-9
    # ends of segments are the business of the box
    for side, room in ((LOW, points - field.bounds[0]), (HIGH, field.bounds[1] - points)):
        for d in range(2):
            least = room[:, :, d].argmin(axis=1)
            for segment in np.flatnonzero((least > 0) & (least < len(t) - 1)):
                clear = room[segment, least[segment], d]
                if clear < REACH:
                    assert near[side - d] <= clear + 1e-9


@given(windows)
@settings(deadline=None, max_examples=200, derandomize=True)
def test_the_violation_is_a_sum_over_all_limits(drawn: tuple[Window, np.ndarray]) -> None:
    here = expanded(*drawn)
    worst: dict[tuple[int, int], float] = {}
    for contact in here.contact:
        thing = int(contact["segment"]), int(contact["what"])
        worst[thing] = max(worst.get(thing, 0.0), -contact["clearance"])
    length = here.out.length
    lacks = np.maximum(PAPER_LIMITS.shortest - length, length - PAPER_LIMITS.longest)
    expected = sum(worst.values()) + np.maximum(lacks, 0.0).sum()
    assert here.violation == pytest.approx(expected, abs=1e-12)


def test_a_curve_along_a_disc_has_contacts_everywhere() -> None:
    field = Field(
        name="one disc", obstacles=Obstacles.discs([[0.0, 0.0]], [10.0]), start=[0.0, 10.05]
    )
    window = horizon_window(field, State(field.start, np.array([10.05, 0.0])), WindowSettings(), 1)
    end = 10.05 * np.array([np.sin(1.0), np.cos(1.0)])
    here = expanded(window, np.concatenate([end, 10.05 * np.array([np.cos(1.0), -np.sin(1.0)])]))
    pinned = here.contact[(here.contact["what"] == 0) & (here.contact["drift"] == 0.0)]
    assert set(pinned["t"]) >= set(np.arange(1, 17) / 16)
    assert (pinned["clearance"] < NEAR).all()


@pytest.mark.parametrize("t", [0.0, 0.3, 1.0])
def test_what_certification_adds_is_a_contact_at_its_parameter(t: float) -> None:
    window, x = ordinary(2)
    plain = expanded(window, x, reach=1e3)
    here = expanded(window, x, reach=1e3, pinned_contacts=np.array([[1.0, 4.0, t]]))
    assert here.count == plain.count + 1
    same = here.contact[(here.contact["segment"] == 1) & (here.contact["what"] == 4)]
    added = same[-1:]
    assert added["t"] == t
    assert added["drift"] == 0.0
    np.testing.assert_allclose(added["clearance"], clearances(here, added), atol=1e-12)


@pytest.mark.parametrize("final", [False, True])
def test_fixed_numbers_have_no_slope_and_keep_their_values(final: bool) -> None:
    window, x = ordinary(5, final=final)
    here = expanded(window, x)
    assert here.slope.shape[1] == (10 if final else 12)
    np.testing.assert_array_equal(here.out.control[0, (0, 2)], window.chain.knots[0])
    if final:
        np.testing.assert_array_equal(here.out.control[-1, 1], window.field.goal)


@pytest.mark.parametrize("room", [1, 2, 7])
def test_a_full_expansion_keeps_the_first_contacts(room: int) -> None:
    window, x = ordinary(3)
    whole, part = expanded(window, x, reach=20.0), expanded(window, x, reach=20.0, room=room)
    assert whole.count > room == part.count
    for name in NUMBERS:
        np.testing.assert_array_equal(part.contact[name], whole.contact[name][:room])
    np.testing.assert_array_equal(part.slope, whole.slope[:room])


@pytest.mark.parametrize("place", ["at the start", "in a disc", "on a bound", "outside", "there"])
@pytest.mark.parametrize("speed", [0.0, 1e-12, 5.0, 1000.0])
@pytest.mark.parametrize(
    "guess", ["random", "coincident", "without derivatives", "a point", "steep"]
)
@pytest.mark.parametrize("final", [False, True])
def test_all_numbers_are_finite_for_any_chain(
    place: str, speed: float, guess: str, final: bool
) -> None:
    for seed in range(4):
        case = Case(seed, 300, place, speed, guess, final=final, bending_weight=0.01)
        window, chain = case.draw()
        here = expanded(window, window.chain.unknowns(chain), room=4096)
        assert np.isfinite([here.violation, here.length, here.bent]).all()
        assert here.violation >= 0.0
        moving = here.contact["drift"] > 0.0
        numbers = [here.contact[name] for name in NUMBERS]
        for array in (*here.out[:4], here.slope, *numbers, here.contact["mixed"][moving]):
            assert np.isfinite(array).all()
        for array in here.gradient_and_hessian(np.ones(3), np.ones(here.count)):
            assert np.isfinite(array).all()


def test_a_chain_through_a_centre_is_pushed_off_it() -> None:
    field = Field(name="one disc", obstacles=Obstacles.discs([[6.0, 0.0]], [2.0]), start=[0.0, 0.0])
    window = horizon_window(field, State(field.start, np.array([12.0, 0.0])), WindowSettings(), 1)
    here = expanded(window, np.array([12.0, 0.0, 12.0, 0.0]))
    (moving,) = here.contact[(here.contact["what"] == 0) & (here.contact["drift"] > 0.0)]
    assert moving["clearance"] == pytest.approx(-2.0)
    np.testing.assert_allclose(abs(moving["normal"]), [0.0, 1.0], atol=1e-12)
