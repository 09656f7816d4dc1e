"""A least turn radius: its certificate, its contacts to second order, flights that keep it."""

import numpy as np
import pytest

from ferguson_gym.curves.splines import (
    basis,
    curvature,
    derivative,
    from_bezier,
    max_curvature,
    subdivide,
)
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.turn_radius import keeps_turn_radius, too_sharp_at
from planners.interface import Status, initial_state
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.sqp.contacts import CONTACT, Piece, row_weights
from planners.optimization.sqp.elastic_sqp import ElasticSqp, Search
from planners.optimization.sqp.turn_contacts import (
    LEFT,
    RIGHT,
    add_turn,
    add_turn_hessian,
    add_turns,
    too_sharp,
)
from planners.optimization.window import WindowSettings, final_window
from planners.receding_horizon.guided import Guided
from planners.receding_horizon.turn_in import turn_in_routes
from planners.registry import make

PLACE = np.arange(8)
NONE = np.empty((0, 3))


def random_segments(count: int) -> np.ndarray:
    """Loops, near-cusps and curves like those of flights."""
    stream = np.random.default_rng(0)
    control = stream.normal(0.0, 5.0, (count, 4, 2))
    chord = control[:, 1:2] - control[:, :1]
    control[::2, 2:] = chord[::2] + stream.normal(0.0, 2.0, (len(chord[::2]), 2, 2))
    return control


def near_cusp(slow: float, at: float = 0.37) -> np.ndarray:
    """A segment whose derivative falls to (0, slow) at t = `at`, where it is sharpest."""
    t = np.array([0.0, 0.5, 1.0])
    # v = (t - at, slow + (t - at)^2) x 30 as quadratic Bézier points
    values = np.stack([30.0 * (t - at), slow + 30.0 * (t - at) ** 2], axis=1)
    first, last = values[0], values[2]
    middle = 2.0 * values[1] - 0.5 * (first + last)
    end = (first + middle + last) / 3.0
    return np.stack([np.zeros(2), end, first, last])


def test_it_says_yes_just_below_the_least_radius_and_no_just_above() -> None:
    segments = random_segments(1000)
    radius = 1.0 / max_curvature(segments)
    assert (radius > 1e-3).sum() > 900
    for control, least in zip(segments, radius, strict=True):
        assert not keeps_turn_radius(control, (1.0 + 1e-7) * least, 0.0)
        if least > 1e-3:  # rounding may hide a near-cusp's radius
            assert keeps_turn_radius(control, (1.0 - 1e-7) * least, 0.0)


@pytest.mark.parametrize("slow", [1.0, 0.1, 1e-3])
def test_a_turn_between_samples_is_found(slow: float) -> None:
    control = near_cusp(slow)
    assert np.linalg.norm(derivative(control, [0.37])[0]) == pytest.approx(slow)
    radius = slow**2 / 30.0  # |v|^3 / |v x v'| there
    assert keeps_turn_radius(control, 0.999 * radius, 0.0)
    assert not keeps_turn_radius(control, 1.001 * radius, 0.0)
    # a needle: the sharp part is about as wide in t as slow / 30
    t = too_sharp_at(control, 4.0 * radius, 0.0)
    assert curvature(control, [t])[0] > 1.0 / (4.0 * radius) - 1e-9
    for half in (*subdivide(control, 0.2), *subdivide(control, 0.6)):
        assert keeps_turn_radius(half, 0.999 * radius, 0.0)


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.0, 1.5])
def test_arcs_keep_the_radius_of_their_sharpest_point(angle: float) -> None:
    handle = 4.0 / 3.0 * np.tan(angle / 4.0)
    turn = np.array([np.cos(angle), np.sin(angle)])
    points = np.array([[1.0, 0.0], [1.0, handle], turn + handle * turn[::-1] * [1, -1], turn])
    arc = from_bezier(100.0 + 3.0 * points)
    dense = 1.0 / curvature(arc, np.linspace(0.0, 1.0, 100_001)).max()
    assert 2.9 < dense <= 3.0
    assert keeps_turn_radius(arc, dense)
    assert keeps_turn_radius(arc, dense + 9e-6)
    assert not keeps_turn_radius(arc, dense + 1.1e-5)
    assert keeps_turn_radius(arc[:, ::-1], dense)  # mirrored: it turns to the other side


def test_straight_lines_keep_any_radius_and_reversals_none() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 0.0], [9.0, 0.0]])
    back = np.array([[0.0, 0.0], [10.0, 0.0], [-1.0, 0.0], [10.0, 0.0]])
    answers = keeps_turn_radius([[line, back], [np.zeros((4, 2)), 2.0 * line]], 1e6)
    np.testing.assert_array_equal(answers, [[True, False], [False, True]])
    assert not keeps_turn_radius(back, 2e-5)


@pytest.mark.parametrize("radius", [0.0, -2.0, 1e-5, np.nan, np.inf])
def test_a_radius_that_cannot_be_kept_is_refused(radius: float) -> None:
    field = get_field("sparse/train:0")
    with pytest.raises(ValueError, match=f"above the tolerance of .* m, got {radius} m"):
        # the tolerance is known when it plans
        Guided(min_turn_radius=radius).plan(field, initial_state(field), 0)
    with pytest.raises(ValueError, match=f"above the tolerance of 1e-05 m, got {radius} m"):
        keeps_turn_radius(near_cusp(1.0), radius)


def test_turns_in_space_are_refused() -> None:
    with pytest.raises(ValueError, match="planar, got segments in 3 dimensions"):
        keeps_turn_radius(np.ones((4, 3)), 1.0)


def contact_at(control: np.ndarray, radius: float, t: float) -> tuple[float, np.ndarray]:
    """Quantity and gradient of a contact at a fixed t."""
    records, gradients = np.empty(1, CONTACT), np.empty((1, 8))
    add_turn(records, gradients, 0, Piece(0, control, PLACE), radius, t, False)
    return records[0]["clearance"], gradients[0]


def test_contacts_have_the_sign_of_the_limit_and_their_derivatives() -> None:
    stream, step, moved = np.random.default_rng(1), 1e-5, 0
    for control in random_segments(40):
        radius = float(stream.uniform(1.0, 6.0))
        records, gradients = np.empty(100, CONTACT), np.empty((100, 8))
        count = add_turns(records, gradients, 0, Piece(0, control, PLACE), radius, 1e9, NONE)
        signed = records["what"] == LEFT
        for row in range(count):
            contact, slope, left = records[row], gradients[row], signed[row]
            t, side = contact["t"], radius if left else -radius
            (v,), (w,) = derivative(control, [t]), derivative(control, [t], 2)
            room = np.linalg.norm(v) ** 3 - side * (v[0] * w[1] - v[1] * w[0])
            assert contact["clearance"] == pytest.approx(room / (v @ v + 1.0), rel=1e-9, abs=1e-9)
            hessian = np.zeros((8, 8))
            add_turn_hessian(hessian, 1.0, records, row, control, radius, PLACE)
            # by the envelope theorem: a moving contact follows its least value
            expected, curved = np.empty(8), np.empty((8, 8))
            for i in range(8):
                shift = step * (i == PLACE).reshape(4, 2)
                values = []
                for there in (control + shift, control - shift):
                    at = follow(there, side, t) if contact["drift"] > 0.0 else t
                    values.append(contact_at(there, side, at))
                expected[i] = (values[0][0] - values[1][0]) / (2.0 * step)
                curved[i] = (values[0][1] - values[1][1]) / (2.0 * step)
            moved += int(contact["drift"] > 0.0)
            np.testing.assert_allclose(slope, expected, atol=1e-5 * (1 + abs(expected).max()))
            np.testing.assert_allclose(hessian, curved, atol=1e-4 * (1 + abs(curved).max()))
    assert moved > 50


def follow(control: np.ndarray, radius: float, t: float) -> float:
    """Where the limit's quantity is least near t, by bisection of its derivative."""

    def value(at: float) -> float:
        return contact_at(control, radius, at)[0]

    low, high = t - 1e-3, t + 1e-3
    for _ in range(40):
        middle = 0.5 * (low + high)
        if value(middle + 1e-6) > value(middle - 1e-6):
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def test_certification_pins_what_it_finds() -> None:
    chain = np.stack([near_cusp(5.0), near_cusp(0.01), near_cusp(0.01)[:, ::-1]])
    rows = too_sharp(chain, 0.1, 0.0)
    np.testing.assert_array_equal(rows[:, :2], [[1, RIGHT], [2, LEFT]])
    records, gradients = np.empty(100, CONTACT), np.empty((100, 8))
    pinned = rows[:1]
    without = add_turns(records, gradients, 0, Piece(1, chain[1], PLACE), 0.1, -1e9, NONE)
    count = add_turns(records, gradients, 0, Piece(1, chain[1], PLACE), 0.1, -1e9, pinned)
    assert count == without + 1
    assert records[:count]["clearance"].min() < 0.0
    assert len(too_sharp(chain, 0.0, 0.0)) == 0


def test_a_search_keeps_the_radius_where_the_shortest_chain_does_not() -> None:
    """From a heading across the way, among no obstacles: a circle, then a line."""
    field = Field(
        name="aside",
        obstacles=Obstacles.discs(np.empty((0, 2)), []),
        start_derivative=np.array([5.0, -5.0]),
    )
    vehicle = initial_state(field).vehicle
    ways = []
    for radius in (None, 4.0):
        plan = Guided(min_turn_radius=radius).plan(field, initial_state(field), 0)
        assert plan.success
        ways.append(plan.control)
    assert not keeps_turn_radius(ways[0], 4.0).all()
    assert keeps_turn_radius(ways[1], 4.0).all()
    window = final_window(field, vehicle, WindowSettings(), 3)
    assert Search(ElasticSqp(), window, np.inf).fresh.turn_radius == 0.0


@pytest.mark.parametrize("radius", [2.5, 5.0])
def test_every_flight_is_certified_to_keep_the_radius(radius: float) -> None:
    free, bound = make("guided"), Guided(min_turn_radius=radius)
    sharp = 0
    for field in get_fields("standard/train:2-7"):
        plan = bound.plan(field, initial_state(field), 0)
        assert plan.success, field.name
        assert keeps_turn_radius(plan.control, radius).all(), field.name
        assert is_feasible(plan.control, field).all(), field.name
        sampled = curvature(plan.control, np.linspace(0.0, 1.0, 2001))
        assert sampled.max() <= 1.0 / (radius - 1e-5) * (1.0 + 1e-12)
        for decision in plan.decisions:
            assert decision.chain is not None
            assert keeps_turn_radius(decision.chain[1:], radius).all()
        turned = free.plan(field, initial_state(field), 0)
        sharp += not keeps_turn_radius(turned.control, radius).all()
        assert plan.path is not None
        assert turned.path is not None
        assert plan.path.length < 1.003 * turned.path.length, field.name
    assert sharp >= 3


def test_replanning_in_the_middle_flies_the_same() -> None:
    field = get_field("standard/train:3")
    planner = Guided(min_turn_radius=3.0)
    whole = planner.plan(field, initial_state(field), 0)
    rest = planner.plan(field, whole.states[5], 0)
    np.testing.assert_array_equal(rest.control, whole.control[5:])


def test_a_detour_is_flown_where_the_way_is_too_sharp() -> None:
    """The disc ahead leaves only room for ways of farther classes."""
    field = get_field("standard/train:1")
    plan = Guided(min_turn_radius=5.0).plan(field, initial_state(field), 0)
    assert plan.success
    assert keeps_turn_radius(plan.control, 5.0).all()
    assert int(plan.decisions[0].report.start.split()[-1]) > Guided().classes
    turned_into = Guided(min_turn_radius=5.0, detours=0).decide(field, initial_state(field), 0)
    assert turned_into.report.start.startswith("turned to class")


@pytest.mark.parametrize("off", [0.5, 2.0, -2.0, 3.1])
def test_turned_routes_leave_ahead_on_a_circle_and_meet_the_route(off: float) -> None:
    radius, points = 4.0, np.column_stack([np.linspace(0.0, 60.0, 241), np.zeros(241)])
    heading = np.array([np.cos(off), np.sin(off)])
    routes = turn_in_routes(transition.State(np.zeros(2), 5.0 * heading), points, radius)
    assert len(routes) == 2
    for route, side in zip(routes, (1.0, -1.0), strict=True):
        steps = np.diff(route, axis=0)
        turns = np.arctan2(
            steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0],
            np.sum(steps[:-1] * steps[1:], axis=1),
        )
        # chords of a circle every 2.5 degrees, a tangent, and one corner where it meets the route
        assert np.degrees(np.sort(np.abs(turns))[-2]) < 5.1
        assert np.degrees(np.arccos(steps[0] @ heading / np.linalg.norm(steps[0]))) < 1.3
        assert np.sign(turns[0]) == side
        center = radius * side * np.array([-heading[1], heading[0]])
        assert np.linalg.norm(route[:5] - center, axis=1) == pytest.approx(radius)
        assert np.linalg.norm(route - center, axis=1).min() > radius - 0.05
        np.testing.assert_array_equal(route[-1], points[-1])


@pytest.mark.parametrize("degrees", [90.0, 120.0, 180.0])
def test_a_flight_that_heads_away_turns_back(degrees: float) -> None:
    angle = np.radians(45.0 + degrees)
    field = Field(
        name="away",
        obstacles=Obstacles.discs(np.empty((0, 2)), []),
        start=np.array([40.0, 40.0]),
        start_derivative=5.0 * np.array([np.cos(angle), np.sin(angle)]),
    )
    plan = Guided(min_turn_radius=5.0).plan(field, initial_state(field), 0)
    assert plan.success
    assert keeps_turn_radius(plan.control, 5.0).all()
    assert plan.path is not None
    # one circle and the tangent from it to the goal are the shortest way
    off, distance = np.radians(degrees), 60.0 * np.sqrt(2.0)
    center = 5.0 * np.array([np.sin(off), -np.cos(off)])
    to_goal = np.array([distance, 0.0]) - center
    line = np.sqrt(to_goal @ to_goal - 25.0)
    course = np.arctan2(to_goal[1], to_goal[0]) - np.arctan2(5.0, line)
    shortest = line + 5.0 * (off - course)
    assert shortest - 1e-4 < plan.path.length < 1.01 * shortest


def test_a_disc_too_near_to_turn_away_from_is_stuck_without_a_flight() -> None:
    """The circles of the radius to both sides meet it: no flight turns past it."""
    towards = np.array([1.0, 1.0]) / np.sqrt(2.0)
    field = Field(name="ahead", obstacles=Obstacles.discs([9.0 * towards], [6.0]))
    for radius, can in ((2.5, True), (3.5, True), (3.8, False), (6.0, False)):
        # the circles' centres are sqrt(9^2 + R^2) from the disc's, clear if that is R + 6
        assert (np.hypot(9.0, radius) > radius + 6.0) == can
        plan = Guided(min_turn_radius=radius).plan(field, initial_state(field), 0)
        assert plan.success == can, radius
        if not can:
            assert plan.status is Status.STUCK
            assert len(plan.control) == 0


def test_solvers_that_know_no_turns_refuse() -> None:
    field = get_field("sparse/train:0")
    planner = Guided(min_turn_radius=3.0, solver=ByExchange())
    with pytest.raises(ValueError, match=r"has no turn-radius constraint, got 3.0 m; .*MultiStart"):
        planner.decide(field, initial_state(field), 0)


def test_the_weights_of_third_derivatives_are_the_splines() -> None:
    for order in range(4):
        for t in (0.0, 0.3, 1.0):
            np.testing.assert_allclose(row_weights(t, order), basis([t], order)[0], atol=1e-12)


@pytest.mark.slow
def test_flights_of_two_and_a_half_metres_arrive() -> None:
    planner, arrived = Guided(min_turn_radius=2.5), 0
    for field in get_fields("standard/train:0-99"):
        plan = planner.plan(field, initial_state(field), 0)
        if plan.success:
            arrived += 1
            assert keeps_turn_radius(plan.control, 2.5).all(), field.name
    assert arrived >= 99
