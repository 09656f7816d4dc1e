"""Routes through graphs, the Voronoi diagram and the grid: known answers, and what all must be."""

import numpy as np
import pytest
from hypothesis import given, settings

from ferguson_gym.runtime import optional_dependencies
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Route, Router, Status, initial_state
from planners.registry import make
from planners.whole_path.astar import AStar
from planners.whole_path.voronoi import VoronoiEdges
from tests.support.taut_paths import fields, line_depth

MARGIN = 1.2e-7  # of `ferguson_gym.shortest_paths.scene` in the bounds of the paper
ROUTERS: dict[str, Router] = {"voronoi": VoronoiEdges(), "astar": AStar()}
every_router = pytest.mark.parametrize("router", ROUTERS.values(), ids=ROUTERS)


def field_of(centers: object, radii: object, **options: object) -> Field:
    return Field(name="of discs", obstacles=Obstacles.discs(centers, radii), **options)  # type: ignore[arg-type]


def across(centers: object, radii: object) -> Field:
    """From left to right at half height."""
    return field_of(centers, radii, start=(0.0, 50.0), goal=(100.0, 50.0))


def route(router: Router, field: Field) -> Route | None:
    """The route from the start, seen to be what it must."""
    found = router.route(field, transition.initial_state(field), 0)
    if found is not None:
        points = found.points
        np.testing.assert_array_equal(points[0], field.start)
        np.testing.assert_array_equal(points[-1], field.goal)
        steps = np.diff(points, axis=0)
        assert found.length == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-12)
        assert line_depth(points[:-1], points[1:], field).max() <= MARGIN
        exact = exact_length(field)
        assert exact is not None
        assert found.length >= exact - 1e-6
        ((seconds, length),) = found.progress
        assert seconds > 0.0
        assert length == found.length
    return found


def length(router: Router, field: Field) -> float:
    found = route(router, field)
    assert found is not None
    return found.length


@every_router
def test_without_discs_the_route_is_straight(router: Router) -> None:
    assert length(router, field_of([], [])) == pytest.approx(100.0 * np.sqrt(2.0), rel=1e-15)


# the diagram of a disc in the middle and the four corners has its vertices in the middle of each
# side; its edges keep 42.4 m from the centre, and the lines from start to vertices 38.4 m
@pytest.mark.parametrize(
    ("radius", "expected"),
    [(38.0, 2.0 * np.hypot(50.0, 60.0)), (39.0, 20.0 + 120.0 * np.sqrt(2.0))],
)
def test_a_diagram_drawn_by_hand(radius: float, expected: float) -> None:
    field = across([[50.0, 50.0]], [radius])
    assert length(VoronoiEdges(per_side=1), field) == pytest.approx(expected, rel=1e-9)


def test_edges_that_collide_are_taken_out() -> None:
    assert route(VoronoiEdges(per_side=1), across([[50.0, 50.0]], [43.0])) is None


@pytest.mark.parametrize(("lower", "upper"), [(30.0, 30.0), (45.0, 15.0)])
def test_beside_a_large_disc_the_diagram_collides_although_there_is_room(
    lower: float, upper: float
) -> None:
    # 10 m wide either way; the edge between the centres runs at y = 55
    field = field_of(
        [[50.0, 20.0], [50.0, 90.0]],
        [lower, upper],
        start=(0.0, 10.0),
        goal=(100.0, 10.0),
        bounds=(0.0, 100.0),
    )
    found = route(VoronoiEdges(), field)
    assert (found is None) == (lower > upper)
    assert length(AStar(), field) < 1.02 * exact_length(field)  # type: ignore[operator]


def test_the_grid_leads_round_a_disc_nearly_as_short_as_can_be() -> None:
    field = across([[50.0, 50.0]], [10.0])
    exact = exact_length(field)
    assert exact is not None
    coarse, fine = (length(AStar(resolution=size), field) for size in (4.0, 0.5))
    assert fine < 1.002 * exact
    assert fine < coarse < 1.05 * exact


@pytest.mark.parametrize(("shift", "finest"), [(0.0, 1.0), (0.45, 0.25)])
def test_a_gap_is_passed_where_a_move_of_the_grid_fits(shift: float, finest: float) -> None:
    # two discs from bound to bound, the gap between them 0.2 m wide
    field = field_of(
        [[50.0, 39.9 + shift], [50.0, 60.1 + shift]],
        [10.0, 10.0],
        start=(0.0, 40.0),
        goal=(100.0, 60.0),
        bounds=[[0.0, 31.0], [100.0, 69.0]],
    )
    assert (route(AStar(resolution=1.0), field) is None) == (finest < 1.0)
    assert length(AStar(resolution=finest), field) < 1.01 * exact_length(field)  # type: ignore[operator]


def test_a_vehicle_between_points_of_the_grid_is_joined_to_it() -> None:
    corner = field_of(
        [[20.0, 20.0]], [12.0], start=(0.37, 3.21), goal=(39.6, 31.3), bounds=(-10.0, 50.0)
    )
    for router in (AStar(), AStar(resolution=3.0)):
        assert length(router, corner) < 1.03 * exact_length(corner)  # type: ignore[operator]


def test_a_wide_field_gets_a_coarser_grid() -> None:
    wide = field_of([[500.0, 500.0]], [200.0], goal=(1e3, 1e3), bounds=(-100.0, 3900.0))
    assert length(AStar(), wide) < 1.02 * exact_length(wide)  # type: ignore[operator]


@every_router
@pytest.mark.parametrize("name", ["standard/train:0-9", "dense/train:0-2", "traps/train:0-2"])
def test_routes_through_the_suites(router: Router, name: str) -> None:
    for field in get_fields(name):
        assert route(router, field) is not None


@every_router
def test_the_seed_has_no_effect(router: Router) -> None:
    field = get_field("standard/train:3")
    first, *others = (
        router.route(field, transition.initial_state(field), seed) for seed in (0, 0, 1)
    )
    assert first is not None
    for other in others:
        assert other is not None
        np.testing.assert_array_equal(other.points, first.points)
        assert other.length == first.length


@every_router
@pytest.mark.parametrize("center", [(0.0, 0.0), (100.0, 100.0)])
def test_a_closed_ring_leaves_no_route(router: Router, center: tuple[float, float]) -> None:
    turn = np.arange(12) * np.pi / 6.0
    ring = center + 8.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    assert route(router, field_of(ring, [2.5] * 12)) is None


@every_router
@pytest.mark.parametrize(("inside", "free"), [(9e-6, True), (2e-5, False)])
def test_a_vehicle_that_touches_gets_away(router: Router, inside: float, free: bool) -> None:
    field = field_of([[50.0, 50.0]], [10.0])
    for position in ([40.0 + inside, 50.0], [-10.0 - inside, 50.0]):
        vehicle = transition.State(np.array(position), np.array([5.0, 0.0]), 4)
        found = router.route(field, vehicle, 0)
        assert (found is not None) == free
        if found is not None:
            np.testing.assert_array_equal(found.points[0], position)
            assert line_depth(found.points[:-1], found.points[1:], field).max() <= inside + MARGIN


@every_router
def test_at_the_goal_there_is_nothing_left_to_fly(router: Router) -> None:
    field = field_of([[50.0, 50.0]], [10.0])
    found = router.route(field, transition.State(field.goal, np.array([5.0, 0.0]), 9), 0)
    assert found is not None
    assert found.length == 0.0
    np.testing.assert_array_equal(found.points[[0, -1]], [field.goal, field.goal])


@every_router
def test_only_the_plane(router: Router) -> None:
    space = field_of([[50.0, 50.0, 50.0]], [10.0], start=(0, 0, 0), goal=(100, 100, 100))
    with pytest.raises(TypeError, match="in the plane, got 3 dimensions"):
        router.route(space, transition.State(space.start, space.departure), 0)


@given(field=fields())
@settings(deadline=None, max_examples=60, derandomize=True)
def test_in_any_field_routes_are_clear(field: Field) -> None:
    coarse = AStar(resolution=5.0)
    for router in (VoronoiEdges(), coarse):
        route(router, field)


@pytest.mark.parametrize("name", ["voronoi", "astar"])
def test_plans_are_feasible(name: str) -> None:
    for field in get_fields("standard/train:0-4"):
        plan = make(name).plan(field, initial_state(field), 0)
        assert plan.status is Status.SOLVED
        assert is_feasible(plan.control, field).all()
        np.testing.assert_allclose(plan.control[-1, 1], field.goal, atol=PAPER_LIMITS.tolerance)


def test_without_networkx_the_registry_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(optional_dependencies.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"planner 'astar' needs networkx: .*'\.\[peers\]'"):
        make("astar")
    make("voronoi")


@pytest.mark.parametrize("resolution", [0.0, -1.0, np.nan, np.inf])
def test_a_grid_needs_a_resolution(resolution: float) -> None:
    with pytest.raises(ValueError, match="resolution must be positive and finite, got"):
        AStar(resolution=resolution)


def test_the_bounds_need_points() -> None:
    with pytest.raises(ValueError, match="each side needs at least 1 point, got 0"):
        VoronoiEdges(per_side=0)
