"""Drake's Graphs of Convex Sets: routes are free, near the shortest ones, and repeat."""

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import CrashedError, Route, Status, initial_state
from planners.registry import make, plan
from planners.whole_path.gcs import Gcs
from planners.whole_path.gcs.router import WORKER
from planners.whole_path.subprocess_worker import ROOT, Worker
from tests.support.mixed_fields import depth_of_lines, mixed_field

ROUNDING = 1e-5
"""How deep the solver's rounding may lead a route into a polygon [m]."""


@pytest.fixture(scope="module")
def router() -> Gcs:
    pytest.importorskip("pydrake")
    pytest.importorskip("shapely")
    return Gcs()


def found(router: Gcs, field: Field, seed: int = 0) -> Route:
    route = router.route(field, transition.initial_state(field), seed)
    assert route is not None
    np.testing.assert_array_equal(route.points[0], field.start)
    np.testing.assert_array_equal(route.points[-1], field.goal)
    sides = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    assert route.length == pytest.approx(sides.sum(), rel=1e-12)
    assert route.progress[0][1] == route.length
    return route


def gap(route: Route, field: Field) -> float:
    exact = exact_length(field)
    assert exact is not None
    return route.length / exact - 1.0


def ring(center: float) -> Field:
    turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    around = 6.0 * np.column_stack([np.cos(turn), np.sin(turn)]) + center
    return Field(name="ring", obstacles=Obstacles.discs(around, np.full(16, 2.0)))


@pytest.mark.parametrize("name", ["paper:1", "paper:2", "paper:3", "paper:4", "traps/train:0"])
def test_routes_are_free_and_a_fifth_of_a_percent_above_the_shortest(
    router: Gcs, name: str
) -> None:
    field = get_field(name)
    route = found(router, field)
    assert depth_of_lines(route.points[:-1], route.points[1:], field).max() <= ROUNDING
    assert 0.0 < gap(route, field) < 0.0025


@pytest.mark.parametrize("seed", range(3))
def test_routes_among_shapes_are_free(router: Gcs, seed: int) -> None:
    field = mixed_field(seed)
    if exact_length(field) is None:
        pytest.skip("no way to the goal")
    route = found(router, field)
    assert depth_of_lines(route.points[:-1], route.points[1:], field).max() <= ROUNDING
    assert gap(route, field) < 0.01


def test_more_corners_bring_routes_nearer_to_the_shortest(router: Gcs) -> None:
    field = get_field("paper:4")
    few, many = (found(replace(router, corners=corners), field) for corners in (6, 24))
    assert gap(many, field) < 0.5 * gap(few, field)


def test_routes_leave_in_the_direction_of_the_vehicle(router: Gcs) -> None:
    for derivative in ([6.0, 0.0], [0.0, 6.0], [-6.0, 0.0], [-4.0, -4.0]):
        field = Field(name="open", obstacles=Obstacles.discs([], []), start_derivative=derivative)
        points = found(router, field).points
        first = 4.0 * (points[1] - points[0]) - (points[2] - points[0])  # of a quadratic curve
        np.testing.assert_allclose(
            first / np.linalg.norm(first), derivative / np.linalg.norm(derivative), atol=1e-9
        )


def test_a_vehicle_at_rest_leaves_as_it_likes(router: Gcs) -> None:
    field = get_field("paper:4")
    vehicle = transition.State(field.start, np.zeros(2), 0)
    route = router.route(field, vehicle, 0)
    assert route is not None
    assert route.length <= found(router, field).length + 1e-6


def test_the_same_seed_gives_the_same_route_whatever_was_planned_before(router: Gcs) -> None:
    field = get_field("standard/train:2")
    first = found(replace(router, worker=Worker(WORKER)), field, 7)
    found(router, get_field("sparse/train:0"), 8)
    np.testing.assert_array_equal(first.points, found(router, field, 7).points)


@pytest.mark.parametrize("center", [0.0, 100.0])
def test_an_enclosed_start_or_goal_has_no_route(router: Gcs, center: float) -> None:
    field = ring(center)
    assert router.route(field, transition.initial_state(field), 0) is None


def test_a_start_in_contact_with_a_disc_has_a_route(router: Gcs) -> None:
    touching = Obstacles.discs([[4.0, 3.0], [50.0, 50.0]], [5.0, 10.0])
    found(router, Field(name="touching", obstacles=touching))


def test_a_flight_is_fitted_to_the_route_and_certified(router: Gcs) -> None:
    field = get_field("paper:4")
    planned = make("gcs").plan(field, initial_state(field), 0)
    assert planned.status is Status.SOLVED
    assert planned.path is not None
    assert planned.route is not None
    exact = exact_length(field)
    assert exact is not None
    assert planned.path.length < planned.route.length
    assert planned.path.length / exact - 1.0 < 5e-4


def test_a_late_answer_is_a_crash_and_the_next_one_comes(router: Gcs) -> None:
    hasty = replace(router, timeout=1e-3, worker=Worker(WORKER))
    field = get_field("sparse/train:0")
    with pytest.raises(CrashedError, match=r"did not answer within 0\.001 s"):
        hasty.route(field, transition.initial_state(field), 0)
    found(replace(hasty, timeout=60.0), field)


def test_a_router_can_be_pickled(router: Gcs) -> None:
    field = get_field("sparse/train:0")
    again = pickle.loads(pickle.dumps(router))
    np.testing.assert_array_equal(found(again, field).points, found(router, field).points)


def test_invalid_options_are_refused(router: Gcs) -> None:
    with pytest.raises(ValueError, match="a polygon has at least 3 corners, got 2"):
        replace(router, corners=2)
    with pytest.raises(ValueError, match="at least 1 path must be drawn, got 0"):
        replace(router, paths=0)
    with pytest.raises(ValueError, match="timeout must be positive, got 0"):
        replace(router, timeout=0.0)


def test_without_drake_the_planner_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"'gcs' needs Drake: .*'\.\[gcs\]'"):
        make("gcs")


def test_planners_are_imported_without_drake_and_shapely() -> None:
    late = "len({'pydrake', 'shapely'} & set(sys.modules))"
    program = f"import sys, planners.registry; sys.exit({late})"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True)


def test_it_cannot_stop_at_a_deadline(router: Gcs) -> None:
    with pytest.raises(ValueError, match="planner gcs cannot stop at a deadline"):
        plan("sparse/train:0", "gcs", deadline=1.0)


@pytest.mark.slow
def test_routes_take_the_class_of_the_shortest_path_in_most_fields(router: Gcs) -> None:
    gaps = [gap(found(router, field), field) for field in get_fields("standard/train:0-19")]
    assert np.median(gaps) < 0.002
    assert np.quantile(gaps, 0.9) < 0.004
