"""What is seen of obstacles of every shape, against marches along rays and distances of points."""

from typing import Any

import numpy as np
import pytest

from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State

VIEW = 30.0
CLOSE: dict[str, float] = {"rtol": 0.0, "atol": 2e-6}


def mixed(seed: int) -> Obstacles:
    """Polygons, sharp, round and tiny ones, boxes, long walls, and discs; some overlap."""
    stream = np.random.default_rng(seed)
    triangles = stream.uniform(0.0, 100.0, (6, 1, 2)) + stream.normal(size=(6, 3, 2)) * 5.0
    angles = 2.0 * np.pi * np.arange(12) / 12
    round_ones = [
        middle + size * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        for middle, size in zip(
            stream.uniform(0.0, 100.0, (5, 2)), stream.uniform(0.2, 6.0, 5), strict=True
        )
    ]
    low = stream.uniform(0.0, 90.0, (6, 2))
    return Obstacles.joined(
        [
            Obstacles.discs(stream.uniform(0.0, 100.0, (4, 2)), stream.uniform(0.5, 5.0, 4)),
            Obstacles.polygons(list(triangles), stream.choice([0.0, 1e-4, 1.0], 6)),
            Obstacles.polygons(round_ones, stream.choice([0.0, 0.5], 5)),
            Obstacles.boxes(low, low + stream.uniform(0.1, 9.0, (6, 2))),
            Obstacles.capsules(
                stream.uniform(-20.0, 120.0, (4, 2, 2)), 10.0 ** stream.uniform(-3, 0, 4)
            ),
        ]
    )


def field_of(obstacles: Obstacles) -> Field:
    far = np.array([[-10.0, -10.0], [110.0, 110.0]])
    points = np.random.default_rng(0).uniform(-9.0, 109.0, (4000, 2))
    free = points[(obstacles.signed_distance(points) > 0.01).all(axis=1)]
    return Field(name="shapes", obstacles=obstacles, start=free[0], goal=free[1], bounds=far)


def vehicles(field: Field, number: int, seed: int) -> list[State]:
    """Vehicles outside all obstacles, on their way anywhere; some are very near to one."""
    stream = np.random.default_rng(seed)
    points = stream.uniform(-9.0, 109.0, (20 * number, 2))
    distance = field.obstacles.signed_distance(points)
    nearest = distance.argmin(axis=1)
    close = stream.random(len(points)) < 0.3
    normal = np.take_along_axis(field.obstacles.gradient(points), nearest[:, None, None], axis=1)
    points -= (close * (distance.min(axis=1) - 1e-3))[:, None] * normal[:, 0]
    free = points[(field.obstacles.signed_distance(points) > 5e-4).all(axis=1)][:number]
    angles = stream.uniform(-np.pi, np.pi, len(free))
    # along the axes, too, since boxes are parallel to them
    angles[::4] = np.pi / 4.0 * stream.integers(-4, 4, len(free[::4]))
    ways = 7.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return [State(point, way, 0) for point, way in zip(free, ways, strict=True)]


def seen(field: Field, vehicle: State, **arguments: Any) -> dict[str, np.ndarray]:
    return observe_one(field, vehicle, Settings(**arguments))


def axes_of(vehicle: State) -> np.ndarray:
    """Rows forward and to the left."""
    forward = vehicle.derivative / np.hypot(*vehicle.derivative)
    return np.array([forward, [-forward[1], forward[0]]])


def directions(vehicle: State, number: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(number) / number
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) @ axes_of(vehicle)


@pytest.mark.parametrize("seed", range(4))
def test_rays_are_free_up_to_their_end_and_stop_there(seed: int) -> None:
    field = field_of(mixed(seed))
    hits = 0
    for vehicle in vehicles(field, 40, seed):
        rays = seen(field, vehicle, rays=24)["rays"].astype(float) * VIEW
        for way, reach in zip(directions(vehicle, 24), rays, strict=True):
            marched = np.linspace(0.0, reach, 400)[:, None] * way + vehicle.position
            # deeper than this within reach, and less deep than this behind it, only where a ray
            # grazes, which single precision cannot tell
            depth = field.obstacles.signed_distance(marched).min()
            assert depth > -2e-5
            inside = min((marched - field.bounds[0]).min(), (field.bounds[1] - marched).min())
            assert inside > -2e-5
            if reach < VIEW - 1e-4:
                end = field.obstacles.signed_distance(marched[-1]).min()
                assert min(abs(end), abs(inside)) < 2e-5
                hits += end < 2e-5
    assert hits > 300


@pytest.mark.parametrize("seed", range(4))
def test_obstacles_are_nearest_points_of_cores_with_radii_and_distances(seed: int) -> None:
    field = field_of(mixed(seed))
    obstacles = field.obstacles
    for vehicle in vehicles(field, 25, seed + 9):
        axes = axes_of(vehicle)
        for nearest, focus in ((40, 0.0), (3, 12.0)):
            shown = seen(field, vehicle, observation="discs", nearest=nearest, focus=focus)
            point = vehicle.position + focus * axes[0]
            away = obstacles.signed_distance(point)
            order = [int(k) for k in np.argsort(away) if away[k] < VIEW][:nearest]
            assert shown["mask"].tolist() == [1.0] * len(order) + [0.0] * (nearest - len(order))
            rows = shown["obstacles"].reshape(nearest, 4)
            distance = obstacles.signed_distance(vehicle.position)
            normal = obstacles.gradient(vehicle.position)
            for row, k in zip(rows, order, strict=False):
                radius = obstacles.radii[k]
                offset = -(distance[k] + radius) * normal[k]
                expected = np.array([*(axes @ offset), radius, distance[k]])
                np.testing.assert_allclose(row, np.clip(expected / VIEW, -1, 1), **CLOSE)
            assert not rows[len(order) :].any()


def test_discs_among_other_shapes_are_seen_as_discs_alone() -> None:
    stream = np.random.default_rng(3)
    discs = Obstacles.discs(stream.uniform(0.0, 100.0, (30, 2)), stream.uniform(0.5, 4.0, 30))
    far = Obstacles.boxes([[500.0, 500.0]], [[501.0, 501.0]])  # so that all cores are kept
    alone, among = field_of(discs), field_of(Obstacles.joined([discs, far]))
    for vehicle in vehicles(alone, 30, 5):
        shown = [
            seen(field, vehicle, observation="both", nearest=20, focus=7.0)
            for field in (alone, among)
        ]
        for key, value in shown[0].items():
            np.testing.assert_array_equal(shown[1][key], value)


def test_a_shape_of_many_edges_is_seen_as_the_disc_that_it_is_nearly() -> None:
    angles = 2.0 * np.pi * np.arange(720) / 720
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    fields = [
        field_of(Obstacles.discs([[50.0, 50.0]], [8.0])),
        field_of(Obstacles.polygons([[50.0, 50.0] + 5.0 * ring], 3.0)),
    ]
    for vehicle in vehicles(fields[0], 20, 6):
        round_one, polygon = (seen(field, vehicle, rays=16)["rays"] for field in fields)
        np.testing.assert_allclose(polygon, round_one, rtol=0.0, atol=2e-3)
        assert (polygon >= round_one - 1e-6).all()


@pytest.mark.parametrize("radius", [0.0, 1e-3])
def test_rays_do_not_pass_between_two_edges(radius: float) -> None:
    # each ray meets a corner, up to rounding
    size = 3.3
    square = size * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    field = field_of(Obstacles.polygons([square], radius))
    stream = np.random.default_rng(0)
    number = 0
    for position in stream.uniform(4.0, 18.0, (1500, 2)) * stream.choice([-1.0, 1.0], (1500, 2)):
        way = size * np.sign(position) - position
        vehicle = State(position, 7.0 * way / np.hypot(*way), 0)
        ray = float(seen(field, vehicle, rays=1)["rays"][0]) * VIEW
        if np.hypot(*way) < VIEW:
            assert np.hypot(*way) - 3.0 * radius - 1e-5 < ray < np.hypot(*way) + 1e-5
            number += 1
    assert number > 1000


@pytest.mark.parametrize("depth", [0.0, 6e-6])
@pytest.mark.parametrize("shape", ["box", "rounded", "corner", "cap", "side"])
def test_the_tolerance_lets_no_vehicle_see_through_an_obstacle(shape: str, depth: float) -> None:
    box = [[40.0, 40.0], [50.0, 40.0], [50.0, 60.0], [40.0, 60.0]]
    diagonal = np.array([1.0, 1.0]) / np.sqrt(2.0)
    obstacles, position, normal = {
        "box": (Obstacles.polygons([box]), [50.0, 52.0], [1.0, 0.0]),
        "rounded": (Obstacles.polygons([box], 2.0), [52.0, 52.0], [1.0, 0.0]),
        "corner": (Obstacles.polygons([box], 2.0), [50.0, 60.0] + 2.0 * diagonal, diagonal),
        "cap": (Obstacles.capsules([[[40.0, 50.0], [50.0, 50.0]]], 2.0), [52.0, 50.0], [1.0, 0.0]),
        "side": (Obstacles.capsules([[[40.0, 50.0], [50.0, 50.0]]], 2.0), [45.0, 52.0], [0.0, 1.0]),
    }[shape]
    normal = np.array(normal)
    vehicle = State(np.array(position) - depth * normal, 5.0 * normal, 0)
    rays = seen(field_of(obstacles), vehicle, rays=16)["rays"] * VIEW
    np.testing.assert_allclose(rays[5:12], 0.0, atol=1e-4)  # into it
    np.testing.assert_allclose(rays[[0, 1, 2, 3, 13, 14, 15]], VIEW, rtol=1e-6)  # away from it
    row = seen(field_of(obstacles), vehicle, observation="discs")["obstacles"][:4] * VIEW
    assert row[3] == pytest.approx(-depth, abs=1e-8)
    assert row[0] == pytest.approx(-obstacles.radii[0], abs=1e-4)


def test_from_within_a_polygon_the_nearest_point_is_on_its_outline() -> None:
    field = field_of(Obstacles.boxes([[40.0, 40.0]], [[60.0, 80.0]], 1.0))
    vehicle = State(np.array([57.0, 60.0]), np.array([0.0, 5.0]), 0)
    row = seen(field, vehicle, observation="discs")["obstacles"][:4] * VIEW
    np.testing.assert_allclose(row, [0.0, -3.0, 1.0, -4.0], atol=1e-5)
