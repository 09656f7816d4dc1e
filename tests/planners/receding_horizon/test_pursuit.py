"""Pursuit: what it decides is certified, keeps its margin where there is room, and repeats."""

import itertools
import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from ferguson_gym.guidance.margins import surroundings
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import exact_length, gap
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import fly_segment
from planners.interface import Plan, Replanner, State, Status, initial_state
from planners.receding_horizon.pursuit import Pursuit
from planners.registry import make

NAMES = [
    field.name
    for spec in ("standard/train:0-4", "dense/train:0-3", "traps/train:0-3")
    for field in get_fields(spec)
]
ALONG, ACROSS = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([-1.0, 1.0]) / np.sqrt(2.0)
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


@cache
def field_of(name: str) -> Field:
    return get_field(name)


@cache
def planned(name: str) -> Plan:
    return Pursuit().plan(field_of(name), initial_state(field_of(name)), 0)


def at(*places: tuple[float, float, float]) -> Field:
    """Discs so far along the way, so far to its left, so large [m]."""
    centers = [along * ALONG + left * ACROSS for along, left, _ in places]
    radii = [radius for _, _, radius in places]
    return Field(name="made", obstacles=Obstacles.discs(np.array(centers), np.array(radii)))


def wall(*gaps: tuple[float, float]) -> Field:
    """A wall across the way, 60 m on, but for gaps: so far to the left, so wide [m]."""
    edges = [-90.0, *(left + side * wide / 2 for left, wide in gaps for side in (-1, 1)), 90.0]
    discs = []
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        discs += [(60.0, left, 3.0) for left in np.arange(low + 3.0, high - 3.0, 4.0)]
        discs.append((60.0, high - 3.0, 3.0))
    return at(*discs)


def crossing(control: Array) -> float:
    """How far to the left of the way a flight comes through the wall [m]."""
    along, left = control[:, 1] @ ALONG, control[:, 1] @ ACROSS
    return float(np.interp(60.0, along, left))


@pytest.mark.parametrize("name", NAMES)
def test_flights_arrive_or_fail_honestly_and_all_decisions_are_certified(name: str) -> None:
    field, plan = field_of(name), planned(name)
    assert is_feasible(plan.control, field).all()
    for decision in plan.decisions:
        assert decision.chain is None or is_feasible(decision.chain, field).all()
    assert plan.success == np.array_equal(plan.control[-1, 1], field.goal)
    if not plan.success:
        assert plan.status in (Status.STUCK, Status.OUT_OF_SEGMENTS)
        assert plan.path is None


def test_nearly_all_flights_arrive_by_a_short_way() -> None:
    gaps = []
    for name in NAMES:
        exact = exact_length(field_of(name))
        if (path := planned(name).path) is not None and exact is not None:
            gaps.append(gap(path.length, exact))
    assert len(gaps) >= len(NAMES) - 1
    assert max(gaps) < 0.08
    assert np.median(gaps) < 0.02


def test_the_margin_is_kept_nearly_where_there_is_room() -> None:
    kept = []
    for name in NAMES:
        field, plan = field_of(name), planned(name)
        margins = surroundings(field, 0.8, 0.8).margins
        closest = field.obstacles.closest(plan.control)[0].min(axis=0)
        passed = (closest < 1.5) & (margins > 0.75)
        kept += closest[passed].tolist()
    assert len(kept) > 40
    # one stride cuts the corner by some decimetres at most
    assert min(kept) > 0.25
    assert 0.6 < np.median(kept) < 1.0


@pytest.mark.parametrize("margin", [0.3, 0.8, 1.5])
def test_a_single_disc_is_passed_at_about_the_margin(margin: float) -> None:
    field = at((60.0, 1.0, 6.0))
    plan = Pursuit(margin=margin).plan(field, initial_state(field), 0)
    assert plan.success
    clearance = float(field.obstacles.clearance(plan.control).min())
    assert margin - 0.35 < clearance < margin + 0.1


@pytest.mark.parametrize("narrowest", [0.8, 1.5])
def test_a_gap_a_little_wider_stays_open_and_one_narrower_is_a_wall(narrowest: float) -> None:
    planner = Pursuit(narrowest=narrowest)
    for wide, far in ((narrowest + 0.05, 0.0), (narrowest - 0.05, 20.0)):
        field = wall((0.0, wide), (20.0, 6.0))
        assert surroundings(field, 0.8, narrowest).margins.max() == pytest.approx(0.8)
        plan = planner.plan(field, initial_state(field), 0)
        assert plan.success
        assert crossing(plan.control) == pytest.approx(far, abs=4.0)


def test_where_the_only_gap_is_too_narrow_the_rescue_flies_through() -> None:
    field = wall((0.0, 0.5))
    plan = Pursuit().plan(field, initial_state(field), 0)
    assert plan.success
    assert abs(crossing(plan.control)) < 1.0
    assert any(decision.report.starts for decision in plan.decisions)


@pytest.mark.parametrize("clearance", [0.0, 0.1, 0.3])
def test_from_inside_the_margin_a_flight_steers_back_out(clearance: float) -> None:
    field = at((60.0, 0.0, 6.0))
    # beside the disc, on its left, on the way past it
    position = 60.0 * ALONG + (6.0 + clearance) * ACROSS
    state = State(transition.State(position, 7.0 * ALONG, 9))
    plan = Pursuit().plan(field, state, 0)
    assert plan.success
    assert field.obstacles.clearance(plan.control).min() >= min(0.0, clearance - 0.1)
    ends = field.obstacles.signed_distance(plan.control[:, 1])[:, 0]
    assert ends[0] > clearance + 0.2
    assert (ends > 0.7).all()


def test_from_inside_margins_that_overlap_a_way_is_found() -> None:
    field = at((60.0, 3.6, 3.0), (60.0, -3.6, 3.0), (68.0, 0.0, 3.0))
    vehicle = transition.State(61.5 * ALONG, 7.0 * (ALONG - ACROSS) / np.sqrt(2.0), 9)
    plan = Pursuit().plan(field, State(vehicle), 0)
    assert is_feasible(plan.control, field).all()
    assert plan.success


def test_strides_are_near_the_one_asked_for_and_a_whole_number_of_them_arrives() -> None:
    for stride, number in ((7.0, 20), (5.25, 27), (9.0, 16)):
        plan = Pursuit(stride=stride).plan(OPEN, initial_state(OPEN), 0)
        assert len(plan.control) == number
        chords = np.linalg.norm(plan.control[:, 1] - plan.control[:, 0], axis=1)
        np.testing.assert_allclose(chords, OPEN.distance / number, rtol=1e-4)
    for name in NAMES:
        control = planned(name).control
        chords = np.linalg.norm(control[:, 1] - control[:, 0], axis=1)
        assert np.median(chords) == pytest.approx(7.0, abs=0.25), name
        # the last as long as the others: nothing is left over
        assert chords.min() > 3.5, name


def test_the_seed_has_no_effect() -> None:
    field = field_of(NAMES[0])
    for seed in (1, 2**40):
        again = Pursuit().plan(field, initial_state(field), seed)
        np.testing.assert_array_equal(again.control, planned(NAMES[0]).control)


@pytest.mark.parametrize("name", [NAMES[1], NAMES[-1]])
def test_planning_from_any_state_on_the_way_gives_the_rest(name: str) -> None:
    plan = planned(name)
    for flown, state in enumerate(plan.states[:-1]):
        # of the state no more is needed than where the vehicle is
        again = Pursuit().plan(get_field(name), State(state.vehicle), 0)
        np.testing.assert_array_equal(again.control, plan.control[flown:])


def test_the_segment_planned_next_is_decided_next() -> None:
    field, plan = field_of(NAMES[0]), planned(NAMES[0])
    meant = [decision.chain for decision in plan.decisions]
    assert all(chain is not None and len(chain) == 2 for chain in meant[:-1])
    apart = [
        np.linalg.norm(before[1, 1] - after[0, 1])
        for before, after in itertools.pairwise(meant)
        if before is not None and after is not None
    ]
    assert max(apart) < 0.5
    assert np.median(apart) < 0.05
    last = meant[-1]
    assert last is not None
    assert len(last) == 1
    assert fly_segment(field, plan.states[-2].vehicle, last[0]).flown


def test_decisions_are_steady_under_small_errors_of_the_state() -> None:
    """An expert to learn from: a centimetre beside the way changes a decision by centimetres."""
    field, plan = field_of(NAMES[0]), planned(NAMES[0])
    moved = []
    for state in plan.states[1:-3]:
        vehicle = state.vehicle
        left = np.array([-vehicle.derivative[1], vehicle.derivative[0]])
        left *= 0.01 / np.linalg.norm(left)
        beside = transition.State(vehicle.position + left, vehicle.derivative, vehicle.segments)
        chains = [Pursuit().decide(field, State(one), 0).chain for one in (vehicle, beside)]
        assert chains[0] is not None
        if chains[1] is not None:
            moved.append(np.linalg.norm(chains[0][0, 1] - chains[1][0, 1]))
    assert np.median(moved) < 0.02
    assert sum(distance > 0.3 for distance in moved) <= 1


@pytest.mark.parametrize("name", ["margin", "narrowest", "stride"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_lengths_that_are_not_positive_and_finite_are_refused(name: str, value: float) -> None:
    given: dict[str, Any] = {name: value}
    with pytest.raises(ValueError, match=f"{name} must be a length above 0 m, got {value!r}"):
        Pursuit(**given)


@pytest.mark.parametrize("others", [(0.0,), (5.0, -1.0), (math.nan,)])
def test_other_strides_must_be_positive_and_finite(
    others: tuple[float, ...],
) -> None:
    with pytest.raises(ValueError, match="others must be lengths above 0 m, got"):
        Pursuit(others=others)


def test_fields_that_are_not_planar_are_refused() -> None:
    ball = Field(
        name="ball",
        obstacles=Obstacles.discs([[50.0, 50.0, 50.0]], [5.0]),
        start=[0.0] * 3,
        goal=[100.0] * 3,
        bounds=[[-10.0] * 3, [110.0] * 3],
    )
    with pytest.raises(ValueError, match="planar"):
        Pursuit().plan(ball, State(transition.State(ball.start, ball.departure)), 0)


def test_it_is_registered_and_takes_the_options_of_replanners() -> None:
    planner = make("pursuit")
    assert isinstance(planner, Pursuit)
    assert isinstance(planner, Replanner)
    field = field_of("standard/train:0")
    for name in ("pursuit+sensing=30", "pursuit+backtrack", "pursuit+margin=0.2"):
        plan = make(name).plan(field, initial_state(field), 0)
        assert plan.success
        assert is_feasible(plan.control, field).all()
    with pytest.raises(ValueError, match="planner 'pursuit' keeps no turn radius; guided does"):
        make("pursuit+turn=3")
