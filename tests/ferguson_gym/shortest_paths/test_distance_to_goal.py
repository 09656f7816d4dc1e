"""The distance to the goal and its gradient, from any point, free or not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.taut_paths import assert_is_taut, fields, random_field

NAMES = ["standard/validation:3", "dense/validation:0", "forest/validation:1", "traps/validation:2"]
FIELDS = [*map(get_field, NAMES), *(random_field(seed, 15) for seed in range(4))]
DISC = Field(name="disc", obstacles=Obstacles.discs([[50.0, 50.0]], [20.0]))


def discs_of(field: Field) -> Obstacles:
    assert field.obstacles.are_discs
    return field.obstacles


def free_points(field: Field, number: int, seed: int = 0) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(*field.bounds, (number, 2))
    return points[(discs_of(field).signed_distance(points) > 0.0).all(axis=1)]


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_distance_is_the_length_of_the_shortest_path(field: Field) -> None:
    togo = DistanceToGoal(field)
    points = free_points(field, 60)
    distance, gradient = togo(points)
    for k, point in enumerate(points):
        path = togo.path(point)
        # from the other end, the search grows from the point
        back = Field(name="back", obstacles=field.obstacles, start=field.goal, goal=point)
        assert exact_length(back) == (
            pytest.approx(distance[k], rel=1e-12) if np.isfinite(distance[k]) else None
        )
        if path is None:
            assert distance[k] == np.inf
            assert (gradient[k] == 0.0).all()
            continue
        assert_is_taut(path, field)
        np.testing.assert_array_equal(path.lines[0, 0], point)
        assert path.length == distance[k]
        first = path.lines[0, 1] - point
        np.testing.assert_allclose(
            first, -np.linalg.norm(first) * gradient[k], atol=1e-9, err_msg=str(point)
        )
    np.testing.assert_allclose(np.linalg.norm(gradient[np.isfinite(distance)], axis=1), 1.0)


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_the_gradient_is_that_of_the_distance(field: Field) -> None:
    togo = DistanceToGoal(field)
    points = free_points(field, 400)
    points = points[(discs_of(field).signed_distance(points) > 0.01).all(axis=1)]
    distance, gradient = togo(points)
    known = np.isfinite(distance)
    step = 1e-4
    slopes = np.empty((len(points), 2))
    for d in range(2):
        ahead, behind = (togo(points + sign * step * np.eye(2)[d])[0] for sign in (1.0, -1.0))
        with np.errstate(invalid="ignore"):
            slopes[:, d] = (ahead - behind) / (2.0 * step)
    error = np.linalg.norm(slopes - gradient, axis=1)[known]
    # but for the few points between two ways that are equally short
    assert (error < 1e-4).mean() > 0.99


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_distance_along_a_free_line_changes_by_at_most_its_length(field: Field) -> None:
    togo = DistanceToGoal(field)
    points = free_points(field, 300)
    step = np.random.default_rng(1).normal(0.0, 8.0, points.shape)
    others = np.clip(points + step, *field.bounds)
    shares = np.linspace(0.0, 1.0, 400)[:, None]
    lines = points[:, None] + shares * (others - points)[:, None]
    # samples 0.1 m apart in discs of half a metre and more
    free = discs_of(field).are_free(lines)
    one_end, other_end = togo(points[free])[0], togo(others[free])[0]
    both = np.isfinite(one_end)
    np.testing.assert_array_equal(both, np.isfinite(other_end))
    length = np.linalg.norm(others - points, axis=1)[free]
    assert (abs(one_end - other_end)[both] <= length[both] + 1e-2).all()
    assert (abs(one_end - other_end)[both] <= length[both] + 1e-9).mean() > 0.98


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_distance_decreases_by_the_length_flown_along_the_shortest_path(field: Field) -> None:
    togo = DistanceToGoal(field)
    path = togo.path(field.start)
    if path is None:
        assert field.name.startswith("random")
        return
    for spacing in (0.1, 3.0):
        flown = 0.0
        for k, (start, end) in enumerate(path.lines):
            long = math.dist(start, end)
            for share in np.arange(0.0, 1.0, spacing / max(long, spacing)):
                point = start + share * (end - start)
                assert togo([point])[0][0] == pytest.approx(path.length - flown - share * long)
            flown += long
            if k < len(path.discs):
                for share in np.linspace(0.0, 1.0, 5):
                    at = path.angles[k, 0] + share * (path.angles[k, 1] - path.angles[k, 0])
                    point = path.centers[k] + path.radii[k] * np.array([np.cos(at), np.sin(at)])
                    left = path.length - flown - share * path.radii[k] * path.sweeps[k]
                    assert togo([point])[0][0] == pytest.approx(left, abs=1e-6)
                flown += path.radii[k] * path.sweeps[k]


def test_distance_and_gradient_are_zero_at_the_goal() -> None:
    distance, gradient = DistanceToGoal(DISC)([[100.0, 100.0], [100.0, 99.0]])
    np.testing.assert_array_equal(distance, [0.0, 1.0])
    np.testing.assert_array_equal(gradient, [[0.0, 0.0], [0.0, -1.0]])


def test_at_a_goal_on_a_disc() -> None:
    field = Field(name="on", obstacles=Obstacles.discs([[80.0, 100.0]], [20.0]), bounds=(-50, 150))
    distance, gradient = DistanceToGoal(field)([[60.0, 100.0], [80.0, 80.0], [100.0, 100.0]])
    np.testing.assert_allclose(distance, [20.0 * np.pi, 10.0 * np.pi, 0.0], rtol=1e-12)
    assert abs(gradient[0, 0]) < 1e-12
    np.testing.assert_allclose(gradient[1], [-1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("depth", [0.0, 1e-9, 1e-6, 9e-6])
@pytest.mark.parametrize("turn", np.linspace(0.0, 6.0, 9))
def test_points_within_the_tolerance_are_free(depth: float, turn: float) -> None:
    togo = DistanceToGoal(DISC)
    outward = np.array([np.cos(turn), np.sin(turn)])
    points = 50.0 + np.array([[20.0 - depth], [20.0], [20.0 + 1e-9]]) * outward
    distance, gradient = togo(points)
    np.testing.assert_allclose(distance, distance[1], atol=2e-5)
    np.testing.assert_allclose(gradient, np.tile(gradient[1], (3, 1)), atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, rtol=1e-12)
    path = togo.path(points[0])
    assert path is not None
    assert_is_taut(path, DISC, depth=depth + 2e-7)


def test_a_point_in_a_disc_opens_the_disc_to_no_other_point() -> None:
    togo = DistanceToGoal(DISC)
    asked = [[50.0 - 20.0 / math.sqrt(2.0), 50.0 + 20.0 / math.sqrt(2.0)], [0.0, 0.0]]
    before = togo(asked)[0]
    togo([[50.0, 30.0 + 9e-6], [30.0 + 9e-6, 50.0]])
    np.testing.assert_array_equal(togo(asked)[0], before)
    np.testing.assert_array_equal(togo.scene.discs["reach"], 20.0 - togo.scene.margin)


def test_points_beyond_the_tolerance_are_not() -> None:
    togo = DistanceToGoal(DISC)
    blocked = [
        [50.0, 50.0],
        [50.0, 30.0 + 2e-5],
        [-10.0 - 2e-5, 5.0],
        [5.0, 110.0 + 2e-5],
        [1e9, 0],
    ]
    distance, gradient = togo(blocked)
    assert (distance == np.inf).all()
    assert (gradient == 0.0).all()
    for point in blocked:
        assert togo.path(point) is None
    beside = togo([[-10.0 - 9e-6, 5.0], [5.0, 110.0 + 9e-6], [-10.0, -10.0], [110.0, 110.0]])[0]
    assert np.isfinite(beside).all()
    coarse = DISC.with_limits(tolerance=1.0, slowest=2.0)
    assert np.isfinite(DistanceToGoal(coarse)([[50.0, 30.5], [110.5, 5.0]])[0]).all()


def test_in_a_notch_within_the_tolerance_of_two_discs() -> None:
    notch = Obstacles.discs([[6.0, 8.0], [6.0, -8.0]], [10.0, 10.0])
    togo = DistanceToGoal(Field(name="notch", obstacles=notch, start=(-9, 0), goal=(50.0, 1.0)))
    distance, gradient = togo([[0.0, 0.0], [1e-6, 0.0], [1e-6, 1e-7], [-1e-6, 0.0]])
    np.testing.assert_allclose(distance, distance[0], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0)


def test_no_points_and_points_without_a_path() -> None:
    togo = DistanceToGoal(DISC)
    distance, gradient = togo(np.empty((0, 2)))
    assert distance.shape == (0,)
    assert gradient.shape == (0, 2)
    wall = Obstacles.discs([[50.0, y] for y in range(-10, 111, 5)], [4.0] * 25)
    togo = DistanceToGoal(Field(name="wall", obstacles=wall))
    assert togo([[10.0, 10.0]])[0][0] == np.inf
    assert togo([[90.0, 90.0]])[0][0] == pytest.approx(10.0 * math.sqrt(2.0))


@pytest.mark.parametrize(
    "points", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [[np.nan, 0.0]], [[0.0, np.inf]]]
)
def test_other_points_are_refused(points: object) -> None:
    with pytest.raises(ValueError, match="points must"):
        DistanceToGoal(DISC)(points)  # type: ignore[arg-type]


def test_other_obstacles_are_refused() -> None:
    balls = Obstacles.discs([[5.0, 5.0, 5.0]], [1.0])
    with pytest.raises(TypeError, match="found in the plane, got 3 dimensions"):
        DistanceToGoal(Field(name="balls", obstacles=balls, start=(0, 0, 0), goal=(9, 9, 9)))


@given(field=fields())
@settings(deadline=None, max_examples=150, derandomize=True)
def test_distance_in_random_fields_is_finite_with_unit_gradient_or_infinite(field: Field) -> None:
    grid = np.stack(np.meshgrid(*2 * [np.arange(-10.0, 111.0, 7.5)]), axis=-1).reshape(-1, 2)
    distance, gradient = DistanceToGoal(field)(grid)
    straight = np.linalg.norm(grid - field.goal, axis=1)
    assert (distance >= straight * (1.0 - 1e-12)).all()
    size = np.linalg.norm(gradient, axis=1)
    np.testing.assert_allclose(size, np.isfinite(distance) & (straight > 0.0), atol=1e-12)
    if len(field.obstacles):
        inside = (field.obstacles.signed_distance(grid) < -2e-5).any(axis=1)
        assert (distance[inside] == np.inf).all()
