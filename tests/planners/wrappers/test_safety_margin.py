"""A margin: kept where there is room, given up where there is none."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from agents.flights.flight import fly
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners.interface import Decision, State, initial_state
from planners.receding_horizon.guided import Guided
from planners.registry import make
from planners.wrappers.safety_margin import Margin, grown_field

MARGIN = 0.5


def gap(wide: float) -> Field:
    """A wall across the way with one gap in it, so wide [m]."""
    along, across = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([-1.0, 1.0]) / np.sqrt(2.0)
    radius = 4.0
    sides = [side * (radius + 0.5 * wide + 6.0 * k) for k in range(13) for side in (-1.0, 1.0)]
    centers = [60.0 * along + side * across for side in sides]
    return Field(
        name="gap", obstacles=Obstacles.discs(np.array(centers), np.full(len(sides), radius))
    )


def test_flights_keep_the_margin_where_there_is_room() -> None:
    closest = {}
    for field in get_fields("sparse/train:0-7"):
        plan = make(f"guided+margin={MARGIN}").plan(field, initial_state(field), 0)
        assert plan.success
        assert is_feasible(plan.control, field).all()
        # discs that the start or the goal are nearer to cannot be cleared so far
        room = field.obstacles.signed_distance(np.stack([field.start, field.goal])).min(axis=0)
        clearance, _ = field.obstacles.closest(plan.control)
        closest[field.name] = (clearance.min(axis=0) - np.minimum(room, MARGIN)).min()
    assert min(closest.values()) >= -1e-4, closest
    # without a margin paths touch the obstacles that they pass
    plain = [
        Guided().plan(field, initial_state(field), 0) for field in get_fields("sparse/train:0-7")
    ]
    touching = [
        field.obstacles.clearance(plan.control).min() < 1e-3
        for field, plan in zip(get_fields("sparse/train:0-7"), plain, strict=True)
    ]
    assert sum(touching) >= 4


def test_a_gap_too_narrow_for_the_margin_is_flown_through() -> None:
    field = gap(0.3)
    plan = make(f"guided+margin={MARGIN}").plan(field, initial_state(field), 0)
    assert plan.success
    assert 0.0 < field.obstacles.clearance(plan.control).min() <= 0.15 + 1e-5
    # it went through the gap, not around the wall
    assert plan.path is not None
    assert plan.path.length < 1.1 * field.distance


def test_a_flight_is_its_plan_and_its_decisions_are_certified() -> None:
    name = f"guided+margin={MARGIN}"
    for field in get_fields("dense/train:0-3"):
        plan = make(name).plan(field, initial_state(field), 0)
        flight = fly(name, field)
        assert flight.outcome is plan.status.outcome
        np.testing.assert_array_equal(flight.control, plan.control)
        for decision in plan.decisions:
            if decision.chain is not None:
                assert is_feasible(decision.chain, field).all()


def test_planning_from_any_state_on_the_way_gives_the_rest() -> None:
    field = get_field("sparse/train:1")
    planner = make(f"guided+margin={MARGIN}")
    plan = planner.plan(field, initial_state(field), 0)
    for flown, state in enumerate(plan.states[:-1]):
        again = planner.plan(get_field("sparse/train:1"), state, 0)
        np.testing.assert_array_equal(again.control, plan.control[flown:])


def test_vehicle_start_and_goal_are_never_inside_grown_obstacles() -> None:
    field = get_field("dense/train:0")
    plan = Guided().plan(field, initial_state(field), 0)
    for state in plan.states:
        shown = grown_field(field, state, 3.0)
        assert shown.obstacles.are_discs
        assert field.obstacles.are_discs
        by = shown.obstacles.radii - field.obstacles.radii
        assert (by >= 0.0).all()
        assert by.max() == pytest.approx(3.0)
        for point in (state.vehicle.position, field.start, field.goal):
            # a state flown may be as deep inside an obstacle as the tolerance allows
            assert shown.obstacles.signed_distance(point).min() >= min(
                0.0, field.obstacles.signed_distance(point).min()
            )


def test_the_grown_field_stays_the_same_object_while_nothing_is_near() -> None:
    field = get_field("sparse/train:1")
    plan = make(f"guided+margin={MARGIN}").plan(field, initial_state(field), 0)
    shown = [grown_field(field, state, MARGIN) for state in plan.states]
    radii = [s.obstacles.radii for s in shown if s.obstacles.are_discs]
    for (before, after), (r, s) in zip(
        itertools.pairwise(shown), itertools.pairwise(radii), strict=True
    ):
        assert (before is after) == np.array_equal(r, s)
    assert sum(before is after for before, after in itertools.pairwise(shown)) >= len(shown) // 2
    assert grown_field(field, plan.states[0], 0.0) is field


class Refusing:
    """A planner that decides nothing among obstacles grown by more than a part of a margin."""

    plan = Guided().plan

    def __init__(self, field: Field, most: float) -> None:
        self.field, self.most, self.asked = field, most, []

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        assert field.obstacles.are_discs
        assert self.field.obstacles.are_discs
        self.asked.append(float((field.obstacles.radii - self.field.obstacles.radii).max()))
        decision = Guided().decide(field, state, seed)
        if self.asked[-1] <= self.most:
            return decision
        return replace(decision, chain=None, first_step=None)


@pytest.mark.parametrize(("most", "asked"), [(1.1, [1.0]), (0.5, [1.0, 0.4]), (0.0, [1.0, 0.4, 0])])
def test_the_margin_shrinks_while_planning_fails(most: float, asked: list[float]) -> None:
    field = get_field("sparse/train:0")
    inner = Refusing(field, most)
    decision = Margin(planner=inner, margin=1.0).decide(field, initial_state(field), 0)
    assert decision.chain is not None
    assert inner.asked == pytest.approx(asked)


def test_if_every_margin_fails_there_is_no_decision() -> None:
    field = get_field("sparse/train:0")
    planner = Margin(planner=Refusing(field, -1.0), margin=1.0)
    plan = planner.plan(field, initial_state(field), 0)
    assert not plan.success
    assert len(plan.control) == 0


@pytest.mark.parametrize(
    "name", ["guided+margin=0.5+sensing=20", "single-start+margin=0.5+backtrack"]
)
def test_it_combines_with_sensing_and_backtracking(name: str) -> None:
    for field in get_fields("sparse/train:0-1"):
        plan = make(name).plan(field, initial_state(field), 0)
        assert plan.success
        assert is_feasible(plan.control, field).all()


def test_it_keeps_a_turn_radius_too() -> None:
    field = get_field("sparse/train:0")
    plan = make("guided+margin=0.5+turn=3").plan(field, initial_state(field), 0)
    assert plan.success
    assert keeps_turn_radius(plan.control, 3.0, field.limits.tolerance).all()
    assert field.obstacles.clearance(plan.control).min() > 0.4


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("guided+margin=0", "a margin must be above 0 m and finite, got 0 m"),
        ("guided+margin=nan", "a margin must be above 0 m and finite, got nan m"),
        ("guided+margin=inf", "a margin must be above 0 m and finite, got inf m"),
        ("guided+margin=", "a margin is a number of metres, got ''"),
        ("guided+margin", "a margin is a number of metres, got ''"),
        ("guided+margin=1+margin=2", "carries an option twice"),
        ("astar+margin=1", "planner 'astar' plans its whole path at once and has no option margin"),
        (
            "guided+magrin=1",
            r"unknown option 'magrin=1' of .* \(did you mean 'margin'",
        ),
    ],
)
def test_invalid_margins_are_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(name)
