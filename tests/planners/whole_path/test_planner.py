"""Whole-path planners: a route becomes a flight, or an honest failure."""

import itertools
from dataclasses import dataclass

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from planners.interface import CrashedError, Route, State, Status, initial_state
from planners.optimization.certification import TARGET_TOLERANCE
from planners.registry import make
from planners.whole_path.planner import WholePath
from planners.whole_path.route_fit import fit

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


@dataclass(frozen=True)
class Given:
    """A router that answers what it was given."""

    points: Array | None
    crashes: bool = False

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        if self.crashes:
            raise CrashedError("injected")
        if self.points is None:
            return None
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return Route(
            points=self.points, length=float(steps.sum()), progress=[(0.1, float(steps.sum()))]
        )


@pytest.mark.parametrize(
    "spec",
    [
        "paper:1-4",
        "standard/train:0-9",
        "sparse/train:0-4",
        "dense/train:0-4",
        "traps/train:0-4",
        "forest/train:0-1",
    ],
)
def test_the_exact_path_is_flown_within_a_thousandth(spec: str) -> None:
    planner = make("shortest")
    for field in get_fields(spec):
        plan = planner.plan(field, initial_state(field), 0)
        assert plan.success, field.name
        assert plan.route is not None
        control, exact = plan.control, exact_length(field)
        assert exact is not None
        assert is_feasible(control, field).all()
        np.testing.assert_array_equal(control[0, (0, 2)], [field.start, field.departure])
        np.testing.assert_array_equal(control[-1, 1], field.goal)
        assert plan.route.length == pytest.approx(exact, rel=1e-12)
        # the paths may touch discs to the tolerance, and be that much shorter
        assert -1e-6 <= length(control).sum() / exact - 1.0 < 2e-3


def test_the_fit_pulls_a_detour_taut() -> None:
    corner = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0]])
    chain = fit(corner, OPEN, transition.initial_state(OPEN))
    assert chain is not None
    assert length(chain).sum() == pytest.approx(100.0 * np.sqrt(2.0), rel=1e-6)


def test_the_fit_keeps_to_its_side_of_a_wall() -> None:
    """The way round the left is a metre longer, but it is the way of the route."""
    across = np.linspace(-30.0, 30.0, 41)[:, None] * np.array([1.0, -1.0]) / np.sqrt(2.0)
    wall = Field(name="wall", obstacles=Obstacles.discs(50.0 + across + 0.5, np.full(41, 3.0)))
    lengths = []
    for side in (1.0, -1.0):
        beside = 50.0 + side * 40.0 * np.array([-1.0, 1.0]) / np.sqrt(2.0)
        route = np.array([[0.0, 0.0], beside, [100.0, 100.0]])
        chain = fit(route, wall, transition.initial_state(wall))
        assert chain is not None
        assert is_feasible(chain, wall, TARGET_TOLERANCE).all()
        middle = chain[:, 1][np.abs(chain[:, 1].sum(axis=1) - 100.0).argmin()]
        assert np.sign(middle[1] - middle[0]) == side
        lengths.append(length(chain).sum())
    assert abs(lengths[0] - lengths[1]) < 0.2


def test_a_route_is_fitted_from_the_middle_of_a_flight() -> None:
    field = get_field("standard/train:0")
    whole = make("shortest").plan(field, initial_state(field), 0)
    state = whole.states[5]
    rest = make("shortest").plan(field, State(state.vehicle), 0)
    assert rest.success
    np.testing.assert_array_equal(rest.control[0, 0], state.vehicle.position)
    np.testing.assert_array_equal(rest.control[0, 2], state.vehicle.derivative)
    # what is left of the best chain can hardly be bettered
    assert length(rest.control).sum() <= 1.002 * length(whole.control[5:]).sum()


def test_segments_left_bound_the_fit() -> None:
    few = OPEN.with_limits(segments=9)  # 9 x 15 m are less than the diagonal
    plan = make("shortest").plan(few, initial_state(few), 0)
    assert plan.status is Status.NOT_FITTED
    assert plan.status.outcome is Outcome.GAVE_UP
    assert len(plan.control) == 0
    enough = OPEN.with_limits(segments=10)
    assert make("shortest").plan(enough, initial_state(enough), 0).success


@pytest.mark.parametrize("flown", [40, 41])
def test_where_no_segments_are_left_nothing_is_fitted(flown: int) -> None:
    vehicle = transition.State(OPEN.start, OPEN.departure, flown)
    plan = make("shortest").plan(OPEN, State(vehicle), 0)
    assert (plan.status, len(plan.control)) == (Status.OUT_OF_SEGMENTS, 0)
    straight = np.stack([OPEN.start, OPEN.goal])
    assert fit(straight, OPEN, vehicle) is None


def test_a_heading_into_a_disc_cannot_be_fitted() -> None:
    field = Field(
        name="ahead",
        obstacles=Obstacles.discs([[4.0, 0.0]], [3.5]),
        start_derivative=np.array([60.0, 0.0]),
    )
    plan = make("shortest").plan(field, initial_state(field), 0)
    assert plan.status is Status.NOT_FITTED
    assert plan.route is not None


def test_no_route_and_a_crash_are_failures_with_a_name() -> None:
    none = WholePath(router=Given(None)).plan(OPEN, initial_state(OPEN), 0)
    assert (none.status, none.route, none.path) == (Status.NO_ROUTE, None, None)
    crash = WholePath(router=Given(None, crashes=True)).plan(OPEN, initial_state(OPEN), 0)
    assert crash.status is Status.CRASHED
    walled = Field(
        name="walled",
        obstacles=Obstacles.discs(
            [100.0 + 8.0 * np.array([np.cos(a), np.sin(a)]) for a in np.arange(0.0, 6.3, 0.2)],
            np.full(32, 1.0),
        ),
    )
    assert make("shortest").plan(walled, initial_state(walled), 0).status is Status.NO_ROUTE


def test_routes_with_repeated_points_are_fitted() -> None:
    points = np.repeat(np.array([[0.0, 0.0], [30.0, 50.0], [100.0, 100.0]]), 3, axis=0)
    plan = WholePath(router=Given(points)).plan(OPEN, initial_state(OPEN), 0)
    assert plan.success


def test_the_report_counts_all_the_time_there_is() -> None:
    plan = make("shortest").plan(OPEN, initial_state(OPEN), 0)
    assert plan.route is not None
    (decision,) = plan.decisions
    assert decision.report.seconds >= plan.route.progress[-1][0] > 0.0
    assert len(plan.states) == len(plan.control) + 1


def test_a_crooked_route_buys_no_better_chain_than_a_straight_one() -> None:
    field = get_field("sparse/train:1")
    straight = make("shortest").plan(field, initial_state(field), 0)
    assert straight.route is not None
    points = straight.route.points[::20]
    # to and fro along the way
    crooked = np.concatenate([[a, b, a] for a, b in itertools.pairwise(points)])
    plan = WholePath(router=Given(np.vstack([crooked, field.goal]))).plan(
        field, initial_state(field), 0
    )
    assert plan.route is not None
    assert plan.route.length > 2.0 * straight.route.length
    assert len(plan.control) == len(straight.control)
    assert length(plan.control).sum() == pytest.approx(length(straight.control).sum(), rel=1e-5)


def test_a_crash_is_reported() -> None:
    crash = WholePath(router=Given(None, crashes=True)).plan(OPEN, initial_state(OPEN), 0)
    assert crash.reason == "injected"
