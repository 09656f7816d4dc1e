"""Routes of all baselines among blocks, walls, slivers and discs: free, and nearly shortest."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Evaluations, Iterations, Route, Router
from planners.whole_path.astar import AStar
from planners.whole_path.ompl import Ompl
from planners.whole_path.swarm import bees, particles
from planners.whole_path.voronoi import VoronoiEdges
from tests.support.mixed_fields import depth_of_lines, mixed_field


def ompl(algorithm: str, iterations: int) -> Callable[[], Router]:
    def made() -> Router:
        pytest.importorskip("ompl")
        return Ompl(algorithm=algorithm, budget=Iterations(iterations))  # type: ignore[arg-type]

    return made


def swarm(of: Callable[[], Router]) -> Callable[[], Router]:
    def made() -> Router:
        pytest.importorskip("pygmo")
        return replace(of(), budget=Evaluations(100_000))  # type: ignore[type-var]

    return made


ROUTERS: dict[str, tuple[Callable[[], Router], float]] = {
    "voronoi": (VoronoiEdges, 1.25),
    "astar": (AStar, 1.01),
    "rrt": (ompl("rrt", 5000), 2.0),
    "rrt-star": (ompl("rrt-star", 500), 1.15),
    "prm": (ompl("prm", 500), 1.1),
    "bit-star": (ompl("bit-star", 5), 1.1),
    "pso": (swarm(particles), 1.3),
    "abc": (swarm(bees), 1.3),
}
"""Each with the most by which its routes exceed the shortest path."""


def route(router: Router, field: Field, vehicle: transition.State | None = None) -> Route | None:
    """The route from a vehicle at the start or elsewhere, whose ends are checked."""
    vehicle = vehicle or transition.initial_state(field)
    found = router.route(field, vehicle, 0)
    if found is not None:
        np.testing.assert_array_equal(found.points[0], vehicle.position)
        np.testing.assert_allclose(found.points[-1], field.goal, rtol=0.0, atol=1e-9)
    return found


def deepest(points: np.ndarray, field: Field) -> float:
    """Depth of a route in obstacles or outside the bounds, at points 1 cm apart [m]."""
    parts = np.ceil(np.linalg.norm(np.diff(points, axis=0), axis=1) / 0.01).astype(int) + 1
    places = zip(points[:-1], points[1:], parts, strict=True)
    fine = np.concatenate([np.linspace(*place) for place in places])
    inside = -field.obstacles.signed_distance(fine).min()
    return float(max(inside, np.maximum(field.bounds[0] - fine, fine - field.bounds[1]).max()))


@pytest.mark.parametrize("name", ROUTERS)
def test_routes_are_free_and_short(name: str) -> None:
    made, excess = ROUTERS[name]
    router = made()
    for seed in range(2):
        field = mixed_field(seed, 40)
        found = route(router, field)
        assert found is not None
        # a swarm's route has points on a curve that is certified to 1e-6 m
        depth = deepest(found.points, field)
        assert depth <= (1e-3 if name in ("pso", "abc") else 1.2e-7)
        exact = exact_length(field)
        assert exact is not None
        assert exact * (1.0 - 1e-6) <= found.length <= excess * exact


@pytest.mark.parametrize("name", ["voronoi", "astar"])
def test_a_street_is_found(name: str) -> None:
    """Two blocks from bound to bound, with 2 m between them."""
    low, high = np.array([[30.0, -10.0], [30.0, 62.0]]), np.array([[70.0, 60.0], [70.0, 110.0]])
    rounded = Obstacles.boxes(low + 3.0, high - 3.0, 3.0)
    for blocks in (Obstacles.boxes(low, high), rounded):
        street = Field(name="street", obstacles=blocks)
        found = route(ROUTERS[name][0](), street)
        assert found is not None
        assert depth_of_lines(found.points[:-1], found.points[1:], street).max() <= 3e-7


@pytest.mark.parametrize("name", ["voronoi", "astar", "rrt"])
def test_closed_walls_leave_no_route(name: str) -> None:
    corners = 20.0 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / 4.0
    walls = Obstacles.capsules(np.stack([corners, np.roll(corners, 1, axis=0)], axis=1), 0.01)
    assert route(ROUTERS[name][0](), Field(name="room", obstacles=walls)) is None


@pytest.mark.parametrize("name", ["voronoi", "astar", "rrt", "bit-star"])
@pytest.mark.parametrize("inside", [0.0, 9e-6, 2e-5])
def test_a_vehicle_that_touches_a_block_gets_away(name: str, inside: float) -> None:
    block = Obstacles.boxes([[40.0, 40.0]], [[60.0, 60.0]])
    field = Field(name="block", obstacles=block)
    for position in ([50.0, 60.0 - inside], [60.0 - inside, 40.0 + inside]):
        vehicle = transition.State(np.array(position), np.array([5.0, 0.0]), 4)
        found = route(ROUTERS[name][0](), field, vehicle)
        assert (found is not None) == (inside < 1e-5)
        if found is not None:
            assert deepest(found.points, field) <= inside + 1.2e-7


@pytest.mark.parametrize("name", ["rrt", "astar", "voronoi"])
def test_ends_may_touch_corners_and_sides(name: str) -> None:
    shapes = Obstacles.joined(
        [
            Obstacles.polygons([[[0.0, 0.0], [-9.0, 5.0], [-9.0, -5.0]]]),
            Obstacles.boxes([[95.0, 101.0]], [[105.0, 108.0]], 1.0),
            Obstacles.capsules([[[30.0, 70.0], [70.0, 30.0]]], 0.5),
        ]
    )
    assert route(ROUTERS[name][0](), Field(name="touching", obstacles=shapes)) is not None
