"""OMPL's planners: routes are collision-free, seeds repeat, and a crash is only an error."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import CrashedError, Iterations, Route, Seconds
from planners.registry import make
from planners.whole_path.ompl import WORKER, Ompl
from planners.whole_path.subprocess_worker import ROOT, Worker, shared_worker

pytest.importorskip("ompl")

FEW = {
    "rrt": Iterations(5000),
    "rrt-star": Iterations(500),
    "prm": Iterations(500),
    "bit-star": Iterations(3),
}
"""Enough for a route through most fields."""
ALGORITHMS = list(FEW)
ROUTERS = {name: Ompl(algorithm=name, budget=budget) for name, budget in FEW.items()}
OPEN = Field(name="open", obstacles=Obstacles.discs(np.empty((0, 2)), []))


def ring(center: float) -> Field:
    turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    around = 6.0 * np.column_stack([np.cos(turn), np.sin(turn)]) + center
    return Field(name="ring", obstacles=Obstacles.discs(around, np.full(16, 2.0)))


def found(router: Ompl, field: Field, seed: int = 0) -> Route:
    route = router.route(field, transition.initial_state(field), seed)
    assert route is not None
    return route


def depth(route: Route, field: Field) -> float:
    """Penetration depth of a route [m], from the nearest point of each line to each disc."""
    assert field.obstacles.are_discs
    deepest = -np.inf
    for start, end in zip(route.points[:-1], route.points[1:], strict=True):
        way = end - start
        along = (field.obstacles.centers - start) @ way / (way @ way)
        nearest = start + np.clip(along, 0.0, 1.0)[:, None] * way
        distance = np.linalg.norm(field.obstacles.centers - nearest, axis=1)
        deepest = max(deepest, float((field.obstacles.radii - distance).max(initial=-np.inf)))
    return deepest


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize("simplify", [True, False])
def test_routes_are_collision_free_reach_the_goal_and_are_not_below_the_optimum(
    name: str, simplify: bool
) -> None:
    router = replace(ROUTERS[name], simplify=simplify)
    for field in get_fields("standard/train:0-4"):
        route = found(router, field)
        assert depth(route, field) <= 1e-9
        low, high = field.bounds
        assert ((route.points >= low) & (route.points <= high)).all()
        np.testing.assert_array_equal(route.points[0], field.start)
        np.testing.assert_array_equal(route.points[-1], field.goal)
        exact = exact_length(field)
        assert exact is not None
        assert exact * (1.0 - 1e-9) <= route.length < 2.0 * exact
        sides = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
        assert route.length == pytest.approx(sides.sum(), rel=1e-12)


@pytest.mark.parametrize("name", ALGORITHMS)
def test_progress_decreases_over_time_to_the_length_of_the_route(name: str) -> None:
    route = found(ROUTERS[name], get_field("standard/train:1"))
    seconds, lengths = np.array(route.progress).T
    assert (np.diff(seconds) >= 0.0).all()
    assert (np.diff(lengths) < 0.0).all()
    assert seconds[0] > 0.0
    assert lengths[-1] == pytest.approx(route.length, rel=1e-12)
    assert len(lengths) >= (2 if name == "rrt" else 4)


def test_the_time_to_set_up_a_problem_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    pose = Ompl._problem

    def slowly(*problem: Any) -> Any:
        time.sleep(0.2)
        return pose(*problem)

    monkeypatch.setattr(Ompl, "_problem", slowly)
    assert found(ROUTERS["rrt"], OPEN).progress[0][0] >= 0.2


@pytest.mark.parametrize("name", ALGORITHMS)
def test_simplifying_shortens(name: str) -> None:
    field = get_field("standard/train:1")
    plain = found(replace(ROUTERS[name], simplify=False), field)
    simplified = found(ROUTERS[name], field)
    assert simplified.length < plain.length
    # the search before it is the same
    assert plain.progress[-1][1] == simplified.progress[-2][1]


@pytest.fixture(scope="module")
def first_routes() -> dict[str, Route]:
    """Routes that are each the first one of their process."""
    field = get_field("standard/train:2")
    return {
        name: found(replace(router, worker=Worker(WORKER)), field, 7)
        for name, router in ROUTERS.items()
    }


@pytest.mark.parametrize("name", ALGORITHMS)
def test_the_same_seed_gives_the_same_route_whatever_was_planned_before(
    name: str, first_routes: dict[str, Route]
) -> None:
    field, router, first = get_field("standard/train:2"), ROUTERS[name], first_routes[name]
    other = found(router, field, 8)
    again = found(router, field, 7)
    np.testing.assert_array_equal(first.points, again.points)
    assert not np.array_equal(first.points, other.points)
    # a step has its own randomness
    moved = transition.State(field.start, field.departure, 1)
    later = router.route(field, moved, 7)
    assert later is not None
    assert not np.array_equal(later.points, first.points)


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize("center", [0.0, 100.0])
def test_a_walled_in_start_or_goal_leaves_no_route(name: str, center: float) -> None:
    field = ring(center)
    assert ROUTERS[name].route(field, transition.initial_state(field), 0) is None


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_budget_in_seconds_is_kept(name: str) -> None:
    found(router := replace(ROUTERS[name], budget=Seconds(0.3)), OPEN)
    began = time.perf_counter()
    field = ring(100.0)
    assert router.route(field, transition.initial_state(field), 0) is None
    # a roadmap is not grown on where its next search would end too late
    least = 0.15 if name == "prm" else 0.3
    assert least <= time.perf_counter() - began < 3.0


@pytest.mark.parametrize("name", ALGORITHMS)
def test_planning_ends_where_no_sample_is_free(name: str) -> None:
    # the disc's circle passes through start and goal, and all else is inside
    disc = Obstacles.discs([[50.0, 50.0]], [50.0 * np.sqrt(2.0)])
    field = Field(name="full", obstacles=disc, bounds=np.array([0.0, 100.0]))
    assert ROUTERS[name].route(field, transition.initial_state(field), 0) is None


@pytest.mark.parametrize("name", ALGORITHMS)
def test_ends_may_touch_discs_and_bounds(name: str) -> None:
    discs = Obstacles.discs([[-3.0, 4.0], [103.0, 96.0], [50.0, 50.0]], [5.0, 5.0, 10.0])
    field = Field(name="touching", obstacles=discs, bounds=np.array([0.0, 100.0]))
    assert depth(found(ROUTERS[name], field), field) <= 1e-9


@pytest.mark.parametrize("name", ALGORITHMS)
@pytest.mark.parametrize(("beyond", "free"), [(0.9e-5, True), (1.1e-5, False)])
def test_a_vehicle_may_violate_discs_and_bounds_by_the_tolerance(
    name: str, beyond: float, free: bool
) -> None:
    in_disc = Field(name="disc", obstacles=Obstacles.discs([[0.0, 10.0]], [5.0]))
    outside = Field(name="bound", obstacles=in_disc.obstacles, bounds=np.array([0.0, 100.0]))
    for field, position in ((in_disc, [0.0, 5.0 + beyond]), (outside, [-beyond, 0.0])):
        vehicle = transition.State(np.array(position), np.array([5.0, 0.0]))
        route = ROUTERS[name].route(field, vehicle, 0)
        assert (route is not None) == free
        if route is not None:
            assert depth(route, field) <= beyond + 1e-9
            np.testing.assert_array_equal(route.points[0], position)


def test_fields_that_are_not_planar_are_refused() -> None:
    balls = Field(
        name="balls",
        obstacles=Obstacles.discs([[50.0, 50.0, 50.0]], [5.0]),
        start=np.zeros(3),
        goal=np.full(3, 100.0),
    )
    vehicle = transition.State(balls.start, balls.departure)
    with pytest.raises(TypeError, match="in the plane, got 3 dimensions"):
        ROUTERS["rrt"].route(balls, vehicle, 0)


def test_a_worker_killed_in_the_middle_is_a_crash_and_the_next_plan_works() -> None:
    field = get_field("standard/train:0")
    before = found(ROUTERS["rrt-star"], field)
    endless = replace(ROUTERS["rrt-star"], budget=Iterations(10**9))
    killed = threading.Timer(0.5, lambda: os.kill(shared_worker(WORKER).pid or 0, signal.SIGSEGV))
    killed.start()
    with pytest.raises(CrashedError, match="ended with exit status -11"):
        endless.route(field, transition.initial_state(field), 0)
    killed.join()
    np.testing.assert_array_equal(found(ROUTERS["rrt-star"], field).points, before.points)


def test_a_timeout_is_a_crash() -> None:
    field = get_field("standard/train:0")
    hasty = replace(ROUTERS["rrt-star"], budget=Iterations(10**9), timeout=0.5)
    with pytest.raises(CrashedError, match=r"did not answer within 0\.5 s"):
        hasty.route(field, transition.initial_state(field), 0)


def test_a_router_can_be_pickled() -> None:
    router = pickle.loads(pickle.dumps(ROUTERS["rrt"]))
    field = get_field("standard/train:0")
    np.testing.assert_array_equal(found(router, field).points, found(ROUTERS["rrt"], field).points)


def test_invalid_options_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown algorithm 'rrt#'; OMPL's are rrt, rrt-star, prm"):
        replace(ROUTERS["rrt"], algorithm="rrt#")
    with pytest.raises(ValueError, match="timeout must be positive, got 0"):
        replace(ROUTERS["rrt"], timeout=0)


def test_without_ompl_its_planners_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for name in ALGORITHMS:
        with pytest.raises(ValueError, match=rf"'{name}' needs OMPL: .*'\.\[peers\]'"):
            make(name)


def test_planners_are_imported_without_ompl() -> None:
    program = "import sys, planners.registry; sys.exit('ompl' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ALGORITHMS)
def test_registered_planners_repeat_bit_for_bit(name: str) -> None:
    router = make(name).router  # type: ignore[attr-defined]
    for field in get_fields("standard/train:0-2"):
        np.testing.assert_array_equal(
            found(router, field, 1).points,
            found(replace(router, worker=Worker(WORKER)), field, 1).points,
        )


@pytest.mark.slow
def test_two_seconds_of_bit_star_come_close_to_the_shortest() -> None:
    router = Ompl(algorithm="bit-star", budget=Seconds(2.0))
    gaps = []
    for field in get_fields("standard/train:0-4"):
        exact = exact_length(field)
        assert exact is not None
        gaps.append(found(router, field).length / exact - 1.0)
    assert np.median(gaps) < 0.006
