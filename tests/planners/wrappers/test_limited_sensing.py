"""A limited sensing range: what is known when, that nothing else counts, flights that arrive."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from agents.flights.flight import fly
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Plan, Replanner, State, initial_state
from planners.receding_horizon.guided import Guided
from planners.registry import make
from planners.wrappers.limited_sensing import Sensing, known_field

REACH = 20.0
FIELDS = ["standard/train:1", "traps/train:0", "traps/train:9"]


def corridor(deep: float) -> Field:
    """A corridor 4 m wide towards the goal, closed so far ahead of the start [m]."""
    along, across = np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([-1.0, 1.0]) / np.sqrt(2.0)
    start, radius = np.array([15.0, 15.0]), 3.0
    walls = [
        start + way * along + side * (radius + 2.0) * across
        for way in np.arange(-6.0, deep, 2.0)
        for side in (-1.0, 1.0)
    ]
    end = [start + (deep + radius) * along + side * across for side in (-3.0, -1.0, 1.0, 3.0)]
    discs = Obstacles.discs(np.array(walls + end), np.full(len(walls) + 4, radius))
    return Field(name="corridor", obstacles=discs, start=start)


def sensed(field: Field, name: str = "guided", reach: float = REACH) -> tuple[Sensing, Plan]:
    planner = make(name)
    assert isinstance(planner, Replanner)
    sensing = Sensing(planner=planner, reach=reach)
    return sensing, sensing.plan(field, initial_state(field), 0)


def without(field: Field, disc: int) -> Field:
    return replace(field, obstacles=field.obstacles.only(np.arange(len(field.obstacles)) != disc))


def seen_at(field: Field, plan: Plan) -> list[int]:
    """Segments flown before each disc came into range of points on them; -1 for never."""
    assert field.obstacles.are_discs
    points = evaluate(plan.control, np.linspace(0.0, 1.0, 4001))
    distance = np.concatenate(
        [
            field.obstacles.signed_distance(field.start)[None],
            [field.obstacles.signed_distance(segment).min(axis=0) for segment in points],
        ]
    )
    assert np.abs(distance - REACH).min() > 1e-5  # no disc is in range by a hair
    near = distance <= REACH
    return [int(rows.argmax()) if rows.any() else -1 for rows in near.T]


@pytest.mark.parametrize("spec", FIELDS)
def test_obstacles_in_range_of_the_path_flown_are_known(spec: str) -> None:
    field = get_field(spec)
    _, plan = sensed(field)
    first = np.array(seen_at(field, plan))
    assert field.obstacles.are_discs
    for flown, state in enumerate(plan.states):
        obstacles = known_field(field, state, REACH).obstacles
        assert obstacles.are_discs
        mask = (first >= 0) & (first <= flown)
        np.testing.assert_array_equal(obstacles.centers, field.obstacles.centers[mask])
        np.testing.assert_array_equal(obstacles.radii, field.obstacles.radii[mask])


def test_the_known_field_stays_the_same_object_until_something_appears() -> None:
    field = get_field("standard/train:1")
    _, plan = sensed(field)
    shown = [known_field(field, state, REACH) for state in plan.states]
    for before, after in itertools.pairwise(shown):
        assert (before is after) == (len(before.obstacles) == len(after.obstacles))


@pytest.mark.parametrize("spec", FIELDS)
def test_no_disc_counts_before_it_was_seen(spec: str) -> None:
    field = get_field(spec)
    _, plan = sensed(field)
    first = seen_at(field, plan)
    late = [disc for disc, seen in enumerate(first) if seen < 0 or seen > 2][::10]
    assert late
    for disc in late:
        _, other = sensed(without(field, disc))
        if first[disc] < 0:
            np.testing.assert_array_equal(other.control, plan.control)
        else:
            same = first[disc]
            np.testing.assert_array_equal(other.control[:same], plan.control[:same])


@pytest.mark.parametrize("name", ["guided", "single-start"])
@pytest.mark.parametrize("reach", [PAPER_LIMITS.longest, REACH])
def test_every_segment_decided_is_feasible_among_all_obstacles(name: str, reach: float) -> None:
    for field in get_fields("dense/train:0-9"):
        _, plan = sensed(field, name, reach)
        for state, decision in zip(plan.states, plan.decisions, strict=False):
            if (chain := decision.chain) is not None:
                assert is_feasible(chain[0], field), field.name
                assert is_feasible(chain, known_field(field, state, reach)).all(), field.name
                np.testing.assert_array_equal(chain[1:, 0::2], chain[:-1, 1::2])


@pytest.mark.parametrize("spec", FIELDS)
def test_planning_from_any_state_on_the_way_gives_the_rest(spec: str) -> None:
    field = get_field(spec)
    planner, plan = sensed(field)
    for flown in range(1, len(plan.control), 4):
        again = planner.plan(get_field(spec), plan.states[flown], 0)
        np.testing.assert_array_equal(again.control, plan.control[flown:])


@pytest.mark.parametrize("name", ["guided+sensing=20", "guided+backtrack+sensing=15"])
def test_a_flight_is_its_plan(name: str) -> None:
    for field in get_fields("traps/train:0-2"):
        plan = make(name).plan(field, initial_state(field), 0)
        flight = fly(name, field)
        assert flight.outcome is plan.status.outcome
        np.testing.assert_array_equal(flight.control, plan.control)


def test_planning_from_the_middle_of_a_flight_knows_nearby_obstacles() -> None:
    field = get_field("standard/train:1")
    planner, plan = sensed(field)
    vehicle = plan.states[4].vehicle
    near = known_field(field, State(vehicle), REACH).obstacles
    assert len(near) == (field.obstacles.signed_distance(vehicle.position) <= REACH).sum()
    assert planner.plan(field, State(vehicle), 0).success


@pytest.mark.parametrize("reach", [PAPER_LIMITS.longest, REACH])
def test_it_flies_into_a_dead_end_and_out_again(reach: float) -> None:
    field = corridor(50.0)
    _, plan = sensed(field, reach=reach)
    assert plan.success
    along = np.array([1.0, 1.0]) / np.sqrt(2.0)
    depth = (plan.control[:, 1] - field.start) @ along
    turned = int(depth[:6].argmax())
    assert depth[turned] > 25.0
    assert np.linalg.norm(plan.control[turned, 1] - field.start - depth[turned] * along) < 2.0
    assert depth[turned:].min() < 0.0
    # who knows the end of the corridor does not enter it
    aware = Guided().plan(field, initial_state(field), 0)
    assert len(aware.control) < len(plan.control)


def test_segments_leave_room_to_turn_before_the_unknown() -> None:
    field = Field(name="open", obstacles=Obstacles.discs([], []))
    _, plan = sensed(field, reach=PAPER_LIMITS.longest)
    assert plan.success
    step = np.linalg.norm(plan.control[:-1, 1] - plan.control[:-1, 0], axis=-1)
    overshoot = 4.0 / 27.0 * np.linalg.norm(plan.control[:-1, 3], axis=-1)
    assert (PAPER_LIMITS.longest - step >= 0.5 * PAPER_LIMITS.shortest + overshoot - 1e-5).all()


def test_a_range_beyond_the_field_changes_nothing() -> None:
    field = get_field("standard/train:3")
    _, plan = sensed(field, reach=1e3)
    np.testing.assert_array_equal(
        plan.control, Guided().plan(field, initial_state(field), 0).control
    )


@pytest.mark.parametrize("reach", [0.0, -1.0, 14.99, float("nan")])
def test_a_range_below_the_longest_segment_is_refused(reach: float) -> None:
    field = get_field("sparse/train:0")
    with pytest.raises(ValueError, match=rf"a sensing range must be .*, got {reach:g} m"):
        Sensing(planner=Guided(), reach=reach).plan(field, initial_state(field), 0)


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["standard", "traps", "dense"])
@pytest.mark.parametrize("reach", [PAPER_LIMITS.longest, REACH])
def test_guided_arrives_with_any_sensing_range(suite: str, reach: float) -> None:
    flights = [sensed(field, reach=reach)[1] for field in get_fields(f"{suite}/train:0-99")]
    assert sum(plan.success for plan in flights) >= 99
