"""What is seen, against slow computations of their own."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ferguson_gym.environment import ObstacleField
from ferguson_gym.world.actions import STEEPEST, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.suites import OF_DISCS

VIEW = 30.0
CLOSE: dict[str, float] = {"rtol": 0.0, "atol": 2e-6}
MIDDLE = np.array([50.0, 50.0])
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
MIRROR = np.array([[1.0, 0.0], [0.0, -1.0]])


def looked(field: Field, **arguments: Any) -> dict:
    """What a vehicle sees at the start of a field."""
    env = ObstacleField(**{"fields": 1, "observation": "discs", **arguments})
    seen, _ = env.reset(options={"field": field})
    assert env.observation_space.contains(seen)
    return seen


def drawn_field(seed: int, number: int = 40, edge: bool = False) -> Field:
    """Discs, and a start anywhere between them, on its way anywhere."""
    stream = np.random.default_rng(seed)
    discs = Obstacles.discs(
        stream.uniform(5.0, 95.0, (number, 2)), stream.uniform(0.5, 7.0, number)
    )
    points = stream.uniform(-10.0, 110.0, (99, 2))
    start, goal = points[(discs.signed_distance(points) > 0.0).all(axis=-1)][:2]
    angle = stream.uniform(-np.pi, np.pi)
    if edge:  # on the edge of the bounds, along an axis
        start, angle = np.array([-10.0, start[1]]), np.pi / 2 * stream.integers(4)
    speed = stream.uniform(0.1, STEEPEST)
    way = np.array([np.cos(angle), np.sin(angle)])
    return Field(
        name=f"{seed}", obstacles=discs, start=start, goal=goal, start_derivative=speed * way
    )


def frame(derivative: np.ndarray) -> np.ndarray:
    """Rows forward and to the left."""
    forward = derivative / np.hypot(*derivative)
    return np.array([forward, QUARTER @ forward])


def vehicle_and_goal(field: Field, position: Any, derivative: Any, left: float) -> list[np.ndarray]:
    low, high = field.bounds
    forward, aside = frame(derivative)
    speed = np.arcsinh(np.hypot(*derivative) / STEEPEST * np.sinh(4.0)) / 4.0
    way = field.goal - position
    distance = np.hypot(*way)
    ahead, left_of = way @ forward / distance, way @ aside / distance
    return [
        np.array([*(2.0 * (position - low) / (high - low) - 1.0), *forward, speed, left]),
        np.array([distance / np.hypot(*(high - low)), ahead, left_of]),
    ]


def nearest_discs(
    field: Field, position: Any, derivative: Any, number: int, focus: float, view: float = VIEW
) -> tuple[np.ndarray, np.ndarray]:
    axes = frame(derivative)
    point = position + focus * axes[0]
    discs = field.obstacles
    away = [
        (np.hypot(*(center - point)) - radius, k)
        for k, (center, radius) in enumerate(zip(discs.centers, discs.radii, strict=True))
    ]
    rows, mask = np.zeros((number, 4)), np.zeros(number)
    chosen = [k for distance, k in sorted(away) if distance < view]
    for row, k in enumerate(chosen[:number]):
        offset = discs.centers[k] - position
        surface = np.hypot(*offset) - discs.radii[k]
        rows[row] = [*(axes @ offset), discs.radii[k], surface]
        mask[row] = 1.0
    return np.clip(rows / view, -1.0, 1.0).ravel(), mask


def ranges(
    field: Field,
    position: Any,
    derivative: Any,
    number: int,
    more: float = 0.0,
    view: float = VIEW,
) -> np.ndarray:
    """Along each ray the least root, of the walls' linear and the discs' quadratic equations.

    With radii that are larger by some metres: a ray that grazes a disc turns a rounding into
    a large error.
    """
    forward, aside = frame(derivative)
    reach = []
    for angle in np.arange(number) * 2.0 * np.pi / number:
        way = np.cos(angle) * forward + np.sin(angle) * aside
        steps = [view]
        for wall in field.bounds:
            with np.errstate(divide="ignore", invalid="ignore"):
                step = (wall - position) / way
            steps += [one for one in step if one > 0.0]
        offset = position - field.obstacles.centers
        half = offset @ way
        square = half**2 - (offset**2).sum(axis=-1) + (field.obstacles.radii + more) ** 2
        cut = square >= 0.0
        for side in (-1.0, 1.0):
            steps += [one for one in side * np.sqrt(square[cut]) - half[cut] if one > 0.0]
        reach.append(min(steps))
    return np.array(reach) / view


def assert_ranges(rays: np.ndarray, *place: Any, view: float = VIEW) -> None:
    assert (rays >= ranges(*place, len(rays), 2e-5, view) - 2e-6).all()
    assert (rays <= ranges(*place, len(rays), -2e-5, view) + 2e-6).all()


def flights(suite: str, **arguments: Any) -> Iterator[tuple[ObstacleField, dict]]:
    """Environments on their way, and what was seen there."""
    env = ObstacleField(suite=suite, fields=1, segments=30, **arguments)
    stream = np.random.default_rng(0)
    for seed in range(6):
        seen, _ = env.reset(seed=seed)
        for _ in range(12):
            yield env, seen
            action = stream.uniform(-0.2, 0.2, 4).astype(np.float32)
            seen, _, terminated, _, _ = env.step(action)
            if terminated:
                break


@pytest.mark.parametrize("suite", OF_DISCS)
@pytest.mark.parametrize(("nearest", "focus"), [(12, 0.0), (3, 10.0), (200, 30.0)])
def test_flights_see_vehicle_goal_and_discs(suite: str, nearest: int, focus: float) -> None:
    for env, seen in flights(suite, observation="discs", nearest=nearest, focus=focus):
        state = env.state
        place = env.field, state.position, state.derivative
        vehicle, goal = vehicle_and_goal(*place, 1.0 - state.segments / 30)
        np.testing.assert_allclose(seen["vehicle"], vehicle, **CLOSE)
        np.testing.assert_allclose(seen["goal"], goal, **CLOSE)
        rows, mask = nearest_discs(*place, nearest, focus)
        np.testing.assert_allclose(seen["obstacles"], rows, **CLOSE)
        np.testing.assert_array_equal(seen["mask"], mask)
        assert env.observation_space.contains(seen)


@pytest.mark.parametrize("view", [9.0, 170.0])
def test_both_are_seen_and_as_far_as_is_asked_for(view: float) -> None:
    seeing: dict[str, Any] = {"observation": "both", "rays": 12, "nearest": 60, "view": view}
    numbers = []
    for env, seen in flights("standard", focus=5.0, **seeing):
        assert list(seen) == ["goal", "mask", "obstacles", "rays", "vehicle"]
        place = env.field, env.state.position, env.state.derivative
        rows, mask = nearest_discs(*place, 60, 5.0, view)
        np.testing.assert_allclose(seen["obstacles"], rows, **CLOSE)
        np.testing.assert_array_equal(seen["mask"], mask)
        assert_ranges(seen["rays"].astype(float), *place, view=view)
        numbers.append(mask.sum())
    assert (max(numbers) < 50) == (view < 20.0)


@pytest.mark.parametrize("suite", OF_DISCS)
def test_flights_see_along_rays(suite: str) -> None:
    for env, seen in flights(suite, observation="rays", rays=12):
        state = env.state
        place = env.field, state.position, state.derivative
        assert seen["rays"].shape == (12,)
        assert_ranges(seen["rays"], *place)
        vehicle, goal = vehicle_and_goal(*place, 1.0 - state.segments / 30)
        np.testing.assert_allclose(seen["vehicle"], vehicle, **CLOSE)
        np.testing.assert_allclose(seen["goal"], goal, **CLOSE)
        assert env.observation_space.contains(seen)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("number", [0, 1, 40])
def test_anywhere_in_any_direction(seed: int, number: int) -> None:
    field = drawn_field(seed, number, edge=seed % 4 == 0)
    place = field, field.start, field.departure
    seen = looked(field, nearest=6, focus=5.0)
    rows, mask = nearest_discs(*place, 6, 5.0)
    np.testing.assert_allclose(seen["obstacles"], rows, **CLOSE)
    np.testing.assert_array_equal(seen["mask"], mask)
    vehicle, goal = vehicle_and_goal(*place, 1.0)
    np.testing.assert_allclose(seen["vehicle"], vehicle, **CLOSE)
    np.testing.assert_allclose(seen["goal"], goal, **CLOSE)
    if seed % 4:  # on the edge a wall is at distance zero, which is no root
        rays = looked(field, observation="rays", rays=17)["rays"]
        assert rays.shape == (17,)
        assert_ranges(rays, *place)


@pytest.mark.parametrize("seed", range(6))
def test_rays_are_free_up_to_their_end_and_stop_there(seed: int) -> None:
    field = drawn_field(seed)
    rays = looked(field, observation="rays", rays=24)["rays"].astype(float) * VIEW
    forward, aside = frame(field.departure)
    for j, reach in enumerate(rays):
        way = np.cos(j * np.pi / 12) * forward + np.sin(j * np.pi / 12) * aside
        march = field.start + np.linspace(0.0, max(reach - 1e-3, 0.0), 2000)[:, None] * way
        assert field.obstacles.signed_distance(march).min() >= 0.0
        assert (field.bounds[0] <= march).all()
        assert (march <= field.bounds[1]).all()
        if reach < VIEW - 1e-3:
            end = field.start + reach * way
            hits = np.abs(field.obstacles.signed_distance(end)).min()
            assert min(hits, np.abs(end - field.bounds).min()) < 1e-3


def test_a_vehicle_on_a_wall_sees_it_touch_and_the_open_side() -> None:
    field = Field(
        name="wall",
        obstacles=Obstacles.discs(np.empty((0, 2)), []),
        start=[-10.0, 50.0],
        goal=[50.0, 50.0],
        start_derivative=[0.0, 5.0],
    )
    rays = looked(field, observation="rays", rays=8)["rays"]
    # into the wall to the left, away from it to the right; along it rounding decides
    np.testing.assert_array_equal(rays[[1, 2, 3, 5, 6, 7]], [0, 0, 0, 1, 1, 1])
    assert looked(field, observation="rays", rays=1)["rays"].tolist() == [1.0]


def test_discs_behind_and_those_touched_do_not_cut_rays() -> None:
    field = Field(
        name="behind",
        obstacles=Obstacles.discs([[40.0, 50.0], [60.0, 54.0], [50.0, 90.0]], [4.0, 4.0, 1.0]),
        start=[50.0, 50.0],
        goal=[90.0, 50.0],
        start_derivative=[5.0, 0.0],
    )
    rays = looked(field, observation="rays", rays=4)["rays"] * VIEW
    np.testing.assert_allclose(rays, [30.0, 30.0, 6.0, 30.0], atol=1e-5)


def around(distances: list[float], radii: list[float]) -> Field:
    """Discs ahead and to the left of a vehicle at (50, 50), at these distances of surfaces."""
    ways = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]
    centers = [
        MIDDLE + (distance + radius) * np.array(ways[k % 4])
        for k, (distance, radius) in enumerate(zip(distances, radii, strict=True))
    ]
    return Field(
        name="around",
        obstacles=Obstacles.discs(centers, radii),
        start=MIDDLE,
        goal=[90.0, 90.0],
        start_derivative=[5.0, 0.0],
    )


def test_discs_at_equal_distances_take_rows_in_their_order() -> None:
    field = around([8.0, 8.0, 8.0, 2.0, 8.0], [2.0, 2.0, 2.0, 1.0, 2.0])
    seen = looked(field, nearest=6)
    rows = seen["obstacles"].reshape(6, 4) * VIEW
    expected = [[0, -3, 1, 2], [10, 0, 2, 8], [0, 10, 2, 8], [-10, 0, 2, 8], [10, 0, 2, 8]]
    np.testing.assert_allclose(rows[:5], expected, atol=1e-5)
    assert seen["mask"].tolist() == [1, 1, 1, 1, 1, 0]
    for number in range(1, 5):
        fewer = looked(field, nearest=number)
        np.testing.assert_array_equal(fewer["obstacles"], seen["obstacles"][: 4 * number])
        assert fewer["mask"].tolist() == [1.0] * number


def test_discs_out_of_view_are_left_out_and_large_numbers_clipped() -> None:
    field = around([29.999, 30.0, 30.5, 12.0], [3.0, 1.0, 1.0, 1.0])
    seen = looked(field, nearest=4)
    assert seen["mask"].tolist() == [1, 1, 0, 0]
    rows = seen["obstacles"].reshape(4, 4)
    np.testing.assert_allclose(rows[0], [0.0, -13 / 30, 1 / 30, 12 / 30], atol=1e-6)
    np.testing.assert_allclose(rows[1], [1.0, 0.0, 0.1, 29.999 / 30], atol=1e-6)
    assert not rows[2:].any()
    # seen from the focus point it is the disc ahead that is nearest, others are out of view
    seen = looked(field, nearest=4, focus=25.0)
    np.testing.assert_allclose(seen["obstacles"][:4], rows[1], atol=1e-6)
    assert seen["mask"].tolist() == [1, 1, 0, 0]


def changed(field: Field, matrix: np.ndarray) -> Field:
    """The field turned or mirrored about the middle of its bounds."""
    discs = field.obstacles
    return Field(
        name="changed",
        obstacles=Obstacles.discs((discs.centers - MIDDLE) @ matrix.T + MIDDLE, discs.radii),
        start=matrix @ (field.start - MIDDLE) + MIDDLE,
        goal=matrix @ (field.goal - MIDDLE) + MIDDLE,
        start_derivative=matrix @ field.departure,
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["discs", "rays"])
def test_a_quarter_turn_and_a_mirror_change_what_they_should(seed: int, kind: str) -> None:
    field = drawn_field(seed)
    arguments = {"observation": kind, "focus": 3.0, "rays": 15}
    seen = looked(field, **arguments)
    turned = looked(changed(field, QUARTER), **arguments)
    mirrored = looked(changed(field, MIRROR), **arguments)
    for other, matrix in ((turned, QUARTER), (mirrored, MIRROR)):
        for part in (slice(0, 2), slice(2, 4)):
            expected = matrix @ seen["vehicle"][part]
            np.testing.assert_allclose(other["vehicle"][part], expected, **CLOSE)
        np.testing.assert_array_equal(other["vehicle"][5], seen["vehicle"][5])
    np.testing.assert_allclose(turned["goal"], seen["goal"], **CLOSE)
    np.testing.assert_allclose(mirrored["goal"], seen["goal"] * [1, 1, -1], **CLOSE)
    if kind == "rays":
        np.testing.assert_allclose(turned["rays"], seen["rays"], rtol=0, atol=1e-4)
        around = np.roll(seen["rays"][::-1], 1)
        np.testing.assert_allclose(mirrored["rays"], around, rtol=0, atol=1e-4)
    else:
        np.testing.assert_allclose(turned["obstacles"], seen["obstacles"], **CLOSE)
        signs = np.tile([1, -1, 1, 1], 12)
        np.testing.assert_allclose(mirrored["obstacles"], seen["obstacles"] * signs, **CLOSE)
        np.testing.assert_array_equal(turned["mask"], seen["mask"])
        np.testing.assert_array_equal(mirrored["mask"], seen["mask"])


@pytest.mark.parametrize("kind", ["discs", "rays"])
@pytest.mark.parametrize("inside", [False, True])
def test_the_tolerance_leads_out_of_no_space(kind: str, inside: bool) -> None:
    # a wall of the bounds or a disc, 6 micrometres beyond which the segment ends
    disc = Obstacles.discs([[39.0, 60.0]], [11.0]) if inside else Obstacles.discs([], [])
    bounds = [-10.0 if inside else 50.0, 110.0]
    field = Field(
        name="edge",
        obstacles=disc,
        start=[51.0, 51.0],
        goal=[90.0, 90.0],
        bounds=bounds,
        start_derivative=[0.0, 9.0],
    )
    env = ObstacleField(observation=kind, rays=16)
    env.reset(options={"field": field})
    segment = np.array([[51.0, 51.0], [50.0 - 6e-6, 60.0], [0.0, 9.0], [0.0, 9.0]])
    seen, *_, info = env.step(encode(segment, segment[0], segment[2]))
    assert info["segments"] == 1
    assert env.state.position[0] < 50.0 - 1e-6
    assert env.observation_space.contains(seen)
    if kind == "rays":
        assert seen["rays"][4] == 0.0
        np.testing.assert_allclose(seen["rays"][12], 1.0)


def test_on_the_goal_the_goal_is_ahead() -> None:
    goal = Field(name="close", obstacles=Obstacles.discs([], []), goal=[9.0 / 2**0.5] * 2)
    env = ObstacleField(gate=1.0)
    env.reset(options={"field": goal})
    seen, _, terminated, _, info = env.step(np.zeros(4, np.float32))
    assert terminated
    assert info["is_success"]
    assert seen["goal"].tolist() == [0.0, 1.0, 0.0]
