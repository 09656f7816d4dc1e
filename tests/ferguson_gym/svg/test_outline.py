"""Outlines are the boundaries of obstacles, and path data draws them."""

import re

import numpy as np
import pytest

from ferguson_gym.svg.outline import outline
from ferguson_gym.svg.path_data import outline_data
from ferguson_gym.world import Obstacles

SHAPES = {
    "disc": Obstacles.discs([[30.0, -20.0]], [7.0]),
    "capsule": Obstacles.capsules([[[-5.0, 3.0], [40.0, 21.0]]], 2.5),
    "box": Obstacles.boxes([[2.0, 3.0]], [[9.0, 30.0]]),
    "rounded box": Obstacles.boxes([[2.0, 3.0]], [[9.0, 30.0]], 4.0),
    "thin triangle": Obstacles.polygons([[[0.0, 0.0], [60.0, 1.0], [60.0, 1.2]]], 1.5),
}
every_shape = pytest.mark.parametrize("obstacle", SHAPES.values(), ids=SHAPES)
UNITS = 100.0
"""Units of path data in a metre."""


@every_shape
def test_points_run_once_round_the_boundary(obstacle: Obstacles) -> None:
    points = outline(obstacle.core(0), float(obstacle.radii[0])).points
    distance = obstacle.signed_distance(points)
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    # chords between neighbours stay on the boundary, but for the height of short arcs
    turn = np.pi / 36.0
    chords = 0.5 * (points + np.roll(points, -1, axis=0))
    height = float(obstacle.radii[0]) * (1.0 - np.cos(0.5 * turn))
    assert np.abs(obstacle.signed_distance(chords)).max() <= height + 1e-12
    core, radius = obstacle.core(0), float(obstacle.radii[0])
    edges = np.roll(core, -1, axis=0) - core
    around = float(np.linalg.norm(edges, axis=1).sum()) * radius + np.pi * radius**2
    assert area(points) == pytest.approx(area(core) + around, rel=0.002)


def area(corners: np.ndarray) -> float:
    x, y = corners.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@every_shape
@pytest.mark.parametrize("upwards", [1.0, -1.0])
def test_path_data_draw_the_boundary(obstacle: Obstacles, upwards: float) -> None:
    radius = float(obstacle.radii[0])
    arcs = UNITS * np.array([1.0, upwards]) * outline(obstacle.core(0), radius).arcs
    drawn = on_path(outline_data(arcs, UNITS * radius)) / [UNITS, UNITS * upwards]
    assert np.abs(obstacle.signed_distance(drawn)).max() < 0.02
    # it comes near every point of the boundary
    points = outline(obstacle.core(0), radius).points
    apart = np.linalg.norm(points[:, None] - drawn, axis=-1).min(axis=1)
    assert apart.max() < 1.0


def on_path(data: str) -> np.ndarray:
    """Points (n, 2) of a closed path of lines and arcs in units, as SVG defines them."""
    parts = re.findall(r"([Mlaz])([^Mlaz]*)", data)
    assert [parts[0][0], parts[-1][0]] == ["M", "z"]
    first = point = np.array(re.findall(r"-?\d+", parts[0][1]), float)
    share = np.linspace(0.0, 1.0, 120)[:, None]
    found = []
    for command, text in parts[1:]:
        numbers = np.array(re.findall(r"-?\d+", text), float)
        step = numbers[-2:] if command != "z" else first - point
        if command != "a":
            found.append(point + share * step)
        else:
            size, _, _, large, positive = numbers[:5]
            assert large == 0
            half = 0.5 * np.linalg.norm(step)
            normal = np.array([-step[1], step[0]]) / (2.0 * half) * (1.0 if positive else -1.0)
            center = point + 0.5 * step + np.sqrt(max(size**2 - half**2, 0.0)) * normal
            start = np.arctan2(*(point - center)[::-1])
            sweep = 2.0 * np.arcsin(min(half / size, 1.0)) * (1.0 if positive else -1.0)
            angles = start + share * sweep
            found.append(center + size * np.hstack([np.cos(angles), np.sin(angles)]))
        point = point + step
    return np.concatenate(found)


def test_discs_are_the_special_case() -> None:
    round_one = outline(np.array([[3.0, 4.0]]), 2.0)
    assert round_one.angles[-1, 1] == pytest.approx(2.0 * np.pi)
    np.testing.assert_allclose(np.linalg.norm(round_one.arcs - [3.0, 4.0], axis=-1), 2.0)


def test_sharp_corners_have_no_arcs() -> None:
    box = SHAPES["box"]
    np.testing.assert_array_equal(outline(box.core(0), 0.0).points, box.core(0))
    assert outline_data(outline(box.core(0), 0.0).arcs, 0.0) == "M2 3l7 0l0 27l-7 0z"
