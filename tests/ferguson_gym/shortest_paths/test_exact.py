"""The shortest path: against tables, formulas and a slow search among polygons."""

import json
import math

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import exact_length, shortest_path
from ferguson_gym.shortest_paths.scene import scene
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.paper_fields import paper_field
from tests.support.places import DATA
from tests.support.taut_paths import field_of, found

# shortest paths to six decimals, found independently
PAPER = json.loads((DATA / "paper_fields.json").read_text())


def across(centers: object, radii: object, height: float = 50.0) -> Field:
    """From left to right at a height."""
    return field_of(centers, radii, start=(0.0, height), goal=(100.0, height))


def around(distance: float, radius: float) -> float:
    """From a distance to a disc's far side at the same distance, straight through its centre."""
    return 2.0 * (
        math.sqrt(distance**2 - radius**2) + radius * (math.pi / 2 - math.acos(radius / distance))
    )


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_papers_fields(number: int) -> None:
    path = found(paper_field(number))
    assert path.length == pytest.approx(PAPER[f"rng{number}"]["exact_shortest_path"], abs=1e-6)


def test_without_discs_the_path_is_straight() -> None:
    path = found(field_of([], []))
    assert path.length == pytest.approx(100.0 * math.sqrt(2.0), rel=1e-15)
    assert path.lines.shape == (1, 2, 2)
    assert path.discs.shape == path.senses.shape == path.sweeps.shape == (0,)


def test_discs_beside_the_way_do_not_matter() -> None:
    path = found(across([[50.0, 70.0], [50.0, 30.0], [300.0, 50.0]], [19.0, 20.0, 80.0]))
    assert path.length == 100.0


@pytest.mark.parametrize(("offset", "sense"), [(3.0, 1), (-3.0, -1)])
def test_one_disc_is_passed_on_the_nearer_side(offset: float, sense: int) -> None:
    path = found(across([[50.0, 50.0 + offset]], [10.0]))
    assert path.senses.tolist() == [sense]
    distance = math.hypot(50.0, 3.0)
    # the angle between start and goal as seen from the centre, less what the tangents span
    sweep = 2.0 * math.asin(50.0 / distance) - 2.0 * math.acos(10.0 / distance)
    length = 2.0 * math.sqrt(distance**2 - 100.0) + 10.0 * sweep
    assert path.length == pytest.approx(length, rel=1e-14)
    assert path.sweeps[0] == pytest.approx(sweep, rel=1e-12)


def test_one_disc_in_the_middle() -> None:
    assert found(across([[50.0, 50.0]], [10.0])).length == pytest.approx(around(50.0, 10.0))


@pytest.mark.parametrize("overlap", [0.0, 0.5e-7, 2e-7, 1e-3])
def test_a_gap_of_zero_is_passed_and_an_overlap_is_not(overlap: float) -> None:
    path = found(across([[50.0, 40.0], [50.0, 60.0 - overlap]], [10.0, 10.0]))
    if overlap < 1e-7:  # the margin is 1.2e-7 m
        assert path.length == pytest.approx(100.0, abs=1e-9)
    else:
        assert path.length > 105.0


@pytest.mark.parametrize("overlap", [0.0, 0.5e-7])
def test_through_a_gap_of_zero_the_path_changes_discs(overlap: float) -> None:
    discs = Obstacles.discs([[50.0, 40.0], [50.0, 60.0 - overlap]], [10.0, 10.0])
    path = found(Field(name="touching", obstacles=discs, start=(0.0, 44.0), goal=(100.0, 56.0)))
    distance = math.hypot(50.0, 4.0)
    sweep = math.atan2(50.0, 4.0) - math.acos(10.0 / distance)
    length = 2.0 * (math.sqrt(distance**2 - 100.0) + 10.0 * sweep)
    assert path.length == pytest.approx(length, abs=1e-6)
    assert path.senses.tolist() == [-1, 1]


@pytest.mark.parametrize("closed", [0.0, 1e-3])
def test_a_disc_that_touches_the_bounds_leaves_one_side(closed: float) -> None:
    field = field_of([[50.0, 95.0 + closed]], [15.0], start=(0.0, 108.0), goal=(100.0, 108.0))
    path = found(field)
    if closed:
        assert path.senses.tolist() == [1]
        assert path.length > 115.0
    else:
        assert path.senses.tolist() == [-1]
        assert path.length < 103.0


def test_a_disc_is_rounded_on_either_side_of_a_corner_of_the_bounds_alone() -> None:
    # three sides of the disc are outside, and two discs lean on the fourth
    closed = field_of([[-5.0, 50.0], [50.0, 50.0], [105.0, 50.0]], [30.0, 30.0, 30.0])
    assert shortest_path(closed) is None
    open_ = field_of([[-5.0, 50.0], [50.0, 50.0], [105.0, 50.0]], [30.0, 20.0, 30.0])
    assert found(open_).length < 150.0


def ring(center: tuple[float, float], radius: float, number: int, size: float) -> Obstacles:
    turn = np.arange(number) * 2 * np.pi / number
    at = np.array(center) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return Obstacles.discs(at, np.full(number, size))


@pytest.mark.parametrize("center", [(0.0, 0.0), (100.0, 100.0)])
def test_a_closed_ring_leaves_no_path(center: tuple[float, float]) -> None:
    closed = Field(name="ring", obstacles=ring(center, 8.0, 12, 2.5))
    assert shortest_path(closed) is None
    assert exact_length(closed) is None
    assert shortest_path(Field(name="open", obstacles=ring(center, 8.0, 12, 2.0))) is not None


def test_a_wall_from_bound_to_bound_leaves_no_path() -> None:
    wall = field_of([[50.0, y] for y in range(-10, 111, 5)], [4.0] * 25)
    assert shortest_path(wall) is None


def rows(radii: np.ndarray) -> Field:
    """Two rows of 61 discs, 2 m apart, that reach beyond the bounds at either end."""
    heights = np.arange(-10.0, 111.0, 2.0)
    at = np.stack([np.repeat([50.0, 60.0], 61), np.tile(heights, 2)], axis=1)
    return field_of(at, radii)


@pytest.mark.parametrize("larger", [None, 0, 60, 61, 121])
def test_rows_that_reach_equally_far_beyond_the_bounds_leave_no_path(larger: int | None) -> None:
    # the common tangent of the rows' ends touches them exactly where they are farthest outside
    radii = np.full(122, 3.0)
    if larger is not None:
        radii[larger] = 3.0001
    assert shortest_path(rows(radii)) is None
    assert exact_length(rows(radii)) is None


@pytest.mark.parametrize(
    "extra",
    [
        [[50.0, 50.0, 10.0]],
        [[50.0, 50.0, 10.0], [50.0, 50.0, 10.0]],
        [[52.0, 49.0, 5.0]],
        [[50.0, 55.0, 5.0]],  # touches from within
        [[50.0, 50.0, 1.0], [50.0, 50.0, 9.0]],
        [[50.0, 50.0, 10.0 + 1e-12]],
        [[50.0, 50.0, 1e-9]],
    ],
)
def test_discs_within_a_disc_change_nothing(extra: list[list[float]]) -> None:
    for every in ([[50.0, 50.0, 10.0], *extra], [*extra, [50.0, 50.0, 10.0]]):
        discs = np.array(every)
        path = found(across(discs[:, :2], discs[:, 2]))
        assert path.length == pytest.approx(around(50.0, 10.0), abs=1e-9)


def test_discs_that_cannot_matter_are_left_out() -> None:
    every = [
        [50.0, 50.0, 10.0],
        [52.0, 49.0, 5.0],  # within the first
        [50.0, 50.0, 10.0],  # the first again
        [50.0, 55.0, 5.0],  # touches the first from within
        [50.0, 61.0, 2.0],  # reaches out of it
        [130.0, 50.0, 15.0],  # outside
        [130.0, 50.0, 21.0],
        [113.0, 113.0, 4.0],  # beyond both bounds at a corner by less than its radius each
        [20.0, 80.0, 1e-8],
    ]
    discs = np.array(every)
    _, kept = scene(across(discs[:, :2], discs[:, 2]))
    assert kept.tolist() == [0, 4, 6]


def test_a_start_and_a_goal_on_a_disc() -> None:
    half = field_of([[50.0, 50.0]], [50.0], start=(0, 50), goal=(100, 50), bounds=(-10, 110))
    assert found(half).length == pytest.approx(50.0 * math.pi, rel=1e-12)
    head_on = field_of([[5.0, 0.0]], [5.0], goal=(20.0, 0.0))
    expected = 5.0 * (math.pi - math.acos(5.0 / 15.0)) + math.sqrt(15.0**2 - 25.0)
    assert found(head_on).length == pytest.approx(expected, rel=1e-12)
    away = field_of([[-5.0, 0.0]], [5.0], goal=(20.0, 0.0))
    assert found(away).length == 20.0
    beside = field_of([[0.0, 5.0]], [5.0], goal=(20.0, 0.0))
    assert found(beside).length == pytest.approx(20.0, rel=1e-15)


def test_a_start_in_the_notch_of_two_discs() -> None:
    notch = Obstacles.discs([[6.0, 8.0], [6.0, -8.0]], [10.0, 10.0])
    away = found(Field(name="away", obstacles=notch, goal=(-10.0, 0.0)))
    assert away.length == 10.0
    path = found(Field(name="back", obstacles=notch, goal=(50.0, 1e-3)))
    # back along the upper disc, over it and down to the goal
    below, distance = math.atan2(8.0 - 1e-3, 44.0), math.hypot(44.0, 8.0 - 1e-3)
    sweep = math.pi + math.atan2(8.0, 6.0) + below - math.acos(10.0 / distance)
    length = 10.0 * sweep + math.sqrt(distance**2 - 100.0)
    assert path.senses.tolist() == [-1]
    assert path.length == pytest.approx(length, rel=1e-12)


def test_a_goal_on_the_common_tangent_of_two_discs() -> None:
    # the tangents to the goal and to the disc between leave the last disc at the same angle
    discs = Obstacles.discs([[0.0, 5.0], [15.0, 10.0], [0.0, 10.0]], [2.5, 10.0, 5.0])
    there = found(Field(name="there", obstacles=discs))
    back = found(Field(name="back", obstacles=discs, start=(100.0, 100.0), goal=(0.0, 0.0)))
    assert there.length == pytest.approx(143.04489325804633, rel=1e-12)
    assert back.length == pytest.approx(there.length, rel=1e-12)


def test_a_row_of_discs_with_a_common_tangent() -> None:
    row = across([[x, 40.0] for x in range(10, 100, 20)], [10.0] * 5)
    assert found(row).length == pytest.approx(100.0, rel=1e-15)
    low = field_of(
        [[x, 40.0] for x in range(10, 100, 20)], [10.0] * 5, start=(0, 44), goal=(100, 44)
    )
    single = math.hypot(10.0, 4.0)
    sweep = math.atan2(10.0, 4.0) - math.acos(10.0 / single)
    expected = 80.0 + 2.0 * (math.sqrt(single**2 - 100.0) + 10.0 * sweep)
    assert found(low).length == pytest.approx(expected, rel=1e-9)


def test_points_are_on_the_path_and_no_further_apart_than_asked() -> None:
    path = found(paper_field(3))
    for spacing in (0.01, 0.7, 1000.0):
        points = path.points(spacing)
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert (steps <= spacing * (1 + 1e-9)).all()
        assert (steps > 0.0).all()
        np.testing.assert_array_equal(points[[0, -1]], [[0.0, 0.0], [100.0, 100.0]])
        assert steps.sum() <= path.length
    assert path.points(0.01).shape[0] == pytest.approx(path.length / 0.01, rel=0.01)
    chords = np.linalg.norm(np.diff(path.points(0.01), axis=0), axis=1).sum()
    assert chords == pytest.approx(path.length, rel=1e-6)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan])
def test_a_spacing_that_is_not_positive_is_refused(spacing: float) -> None:
    with pytest.raises(ValueError, match="spacing must be positive"):
        found(paper_field(1)).points(spacing)


def test_other_obstacles_are_refused_and_have_no_exact_length() -> None:
    balls = Field(
        name="balls",
        obstacles=Obstacles.discs([[5.0, 5.0, 5.0]], [1.0]),
        start=(0, 0, 0),
        goal=(9, 9, 9),
    )
    with pytest.raises(TypeError, match="found in the plane, got 3 dimensions"):
        shortest_path(balls)
    assert exact_length(balls) is None


def test_the_exact_length_is_that_of_the_content_whatever_the_name() -> None:
    field = paper_field(1)
    copy = Field(name="paper:2", obstacles=field.obstacles)
    shorter = Field(name="paper:1", obstacles=field.obstacles, goal=(20.0, 0.0))
    assert exact_length(copy) == exact_length(field) == found(field).length
    assert exact_length(shorter) == found(shorter).length < 50.0
