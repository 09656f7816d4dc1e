"""Straight lines: what stands in their way, what a vehicle on a disc may do, and shortcuts."""

from itertools import combinations

import numpy as np
import pytest

from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from planners.whole_path.line_of_sight import lines_clear, scene_from
from planners.whole_path.shortcut import shortcut
from tests.support.mixed_fields import depth_of_lines, mixed_field
from tests.support.taut_paths import line_depth, random_field

MARGIN = 1.2e-7  # of `ferguson_gym.shortest_paths.scene` in the bounds of the paper


def whole_scene(field: Field) -> Scene:
    scene = scene_from(field, field.start)
    assert scene is not None
    return scene


@pytest.mark.parametrize("seed", range(5))
def test_lines_are_clear_where_they_keep_their_distance(seed: int) -> None:
    field = random_field(seed, 20)
    stream = np.random.default_rng(seed)
    starts, ends = stream.uniform(-12.0, 112.0, (2, 4000, 2))
    ends[:2000] = starts[:2000] + stream.uniform(-5.0, 5.0, (2000, 2))
    clear = lines_clear(whole_scene(field), starts, ends)
    np.testing.assert_array_equal(clear, line_depth(starts, ends, field) <= 0.0)
    assert 100 < clear.sum() < 3900


@pytest.mark.parametrize("seed", range(5))
def test_lines_among_shapes_are_clear_where_they_keep_their_distance(seed: int) -> None:
    field = mixed_field(seed, 20)
    stream = np.random.default_rng(seed)
    starts, ends = stream.uniform(-12.0, 112.0, (2, 4000, 2))
    ends[:2000] = starts[:2000] + stream.uniform(-5.0, 5.0, (2000, 2))
    clear = lines_clear(whole_scene(field), starts, ends)
    np.testing.assert_array_equal(clear, depth_of_lines(starts, ends, field) <= 0.0)
    assert 100 < clear.sum() < 3900


def straight(*points: tuple[float, float]) -> tuple[list[tuple[float, float]], ...]:
    return [points[0]], [points[1]]


@pytest.mark.parametrize("radius", [0.0, 3.0])
@pytest.mark.parametrize("by", [0.0, 1e-7, -1.0, 1.3e-7, 1e-3])
def test_a_line_may_touch_a_block(by: float, radius: float) -> None:
    low, high = np.array([[40.0, 30.0]]), np.array([[60.0, 40.0]])
    block = Obstacles.boxes(low + radius, high - radius, radius)
    scene = whole_scene(Field(name="block", obstacles=block))
    for line in (
        straight((20.0, 40.0 - by), (80.0, 40.0 - by)),  # past a side
        straight((45.0, 40.0 - by), (55.0, 40.0 - by)),
        straight((50.0, 50.0), (50.0, 40.0 - by)),  # with its end on a side
        straight((60.0 - by, 35.0), (60.0 - by, 35.0)),
    ):
        assert lines_clear(scene, *line).tolist() == [by < MARGIN]
    # past a corner; where a line cuts a sharp one off, the deepest point is half as far inside
    total = (
        100.0 - 2.0 * by if radius == 0.0 else 100.0 - 2.0 * radius + np.sqrt(2.0) * (radius - by)
    )
    middle = 0.5 * total
    slanted = straight((middle - 10.0, middle + 10.0), (middle + 10.0, middle - 10.0))
    assert lines_clear(scene, *slanted).tolist() == [by < MARGIN]


@pytest.mark.parametrize("by", [0.0, 1e-7, -1.0, 1.3e-7, 1e-3])
def test_a_line_may_touch(by: float) -> None:
    touched = Field(name="touched", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0]))
    beside, above = [[20.0, 40.0 + by], [80.0, 40.0 + by]], [[20.0, 110.0 + by], [80.0, 110.0 + by]]
    scene = whole_scene(touched)
    assert lines_clear(scene, *beside).tolist() == [by < MARGIN]
    assert lines_clear(scene, *above).tolist() == [by < MARGIN]


def test_a_line_of_length_zero_is_a_point() -> None:
    scene = whole_scene(Field(name="one", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0])))
    points = np.array([[50.0, 50.0], [50.0, 41.0], [50.0, 40.0], [50.0, 30.0], [50.0, -11.0]])
    assert lines_clear(scene, points, points).tolist() == [False, False, True, True, False]


@pytest.mark.parametrize("inside", [9e-6, 1.1e-5])
def test_from_within_the_tolerance_lines_run_no_deeper(inside: float) -> None:
    field = Field(name="one", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0]))
    scene = scene_from(field, np.array([50.0, 40.0 + inside]))
    if inside > 1e-5:
        assert scene is None
        return
    assert scene is not None
    heights = np.array([40.0, 40.0 + inside, 40.0 + 2.0 * inside])
    level = np.column_stack([np.full(3, 50.0), heights])
    ends = np.column_stack([np.full(3, 90.0), heights])
    assert lines_clear(scene, level, ends).tolist() == [True, True, False]


@pytest.mark.parametrize("inside", [9e-6, 1.1e-5])
def test_from_within_the_tolerance_of_a_block_lines_run_no_deeper(inside: float) -> None:
    block = Obstacles.boxes([[40.0, 30.0]], [[60.0, 40.0]])
    field = Field(name="block", obstacles=block)
    scene = scene_from(field, np.array([50.0, 40.0 - inside]))
    if inside > 1e-5:
        assert scene is None
        return
    assert scene is not None
    heights = 40.0 - inside * np.arange(3)
    level = np.column_stack([np.full(3, 45.0), heights])
    ends = np.column_stack([np.full(3, 90.0), heights])
    assert lines_clear(scene, level, ends).tolist() == [True, True, False]


@pytest.mark.parametrize("outside", [9e-6, 1.1e-5])
def test_from_outside_by_the_tolerance_lines_lead_back(outside: float) -> None:
    field = Field(name="none", obstacles=Obstacles.discs([], []))
    position = np.array([-10.0 - outside, 50.0])
    scene = scene_from(field, position)
    if outside > 1e-5:
        assert scene is None
        return
    assert scene is not None
    ends = [field.goal, position - [outside, 0.0]]
    assert lines_clear(scene, position, ends).tolist() == [True, False]


def zigzag(seed: int) -> tuple[Scene, np.ndarray]:
    """Random points, each in sight of the one before."""
    field = random_field(seed, 15, largest=10.0)
    scene, stream = whole_scene(field), np.random.default_rng(seed)
    points = [field.start]
    while len(points) < 9:
        ahead = points[-1] + stream.uniform(-20.0, 40.0, 2)
        if lines_clear(scene, points[-1], ahead).all():
            points.append(ahead)
    return scene, np.array(points)


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@pytest.mark.parametrize("seed", range(10))
def test_no_clear_way_through_some_of_the_points_is_shorter(seed: int) -> None:
    scene, points = zigzag(seed)
    found = shortcut(scene, points)
    between = range(1, len(points) - 1)
    ways = (
        points[[0, *kept, -1]]
        for number in range(len(points) - 1)
        for kept in combinations(between, number)
    )
    best = min(length(way) for way in ways if lines_clear(scene, way[:-1], way[1:]).all())
    assert length(found) == pytest.approx(best, rel=1e-12)
    assert lines_clear(scene, found[:-1], found[1:]).all()
    np.testing.assert_array_equal(found[[0, -1]], points[[0, -1]])


def test_a_clear_way_is_pulled_straight() -> None:
    scene = whole_scene(Field(name="none", obstacles=Obstacles.discs([], [])))
    points = np.array([[0.0, 0.0], [10.0, 30.0], [20.0, 5.0], [40.0, 40.0]])
    np.testing.assert_array_equal(shortcut(scene, points), points[[0, -1]])
    np.testing.assert_array_equal(shortcut(scene, points[:1]), points[:1])
