"""Compiles all kernels in advance, by a flight through a small field."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ferguson_gym.environment import ObstacleField
from ferguson_gym.shortest_paths import exact_length, shortest_path
from ferguson_gym.world import Field, Obstacles
from ferguson_gym.world.actions import encode


@cache
def small_field() -> Field:
    """Two discs and a goal beyond the first window, so that planners meet every kind of window."""
    discs = Obstacles.discs(np.array([[9.0, 9.0], [30.0, 24.0]]), np.array([1.0, 4.0]))
    return Field(name="two discs", obstacles=discs, goal=np.array([40.0, 40.0]))


@cache
def compile_kernels() -> None:
    """Compile the kernels that every flight needs, or load them from the cache; once a process."""
    field = small_field()
    env = ObstacleField(fields=1)
    env.reset(seed=0, options={"field": field})
    env.step(np.zeros(4, np.float32))
    # planners fly among many obstacles through it
    encode([[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [9.0, 0.0]], np.zeros(2), np.array([9.0, 0.0]))
    exact_length(field)
    field.obstacles.closest([[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [9.0, 0.0]])
    # what discs do not need: the path follows an edge, and is so long that more obstacles count
    block = Obstacles.polygons([[[13.0, 31.0], [9.0, 27.0], [27.0, 9.0], [31.0, 13.0]]])
    behind = Obstacles.discs([[-2.5, -2.5], [42.5, 42.5]], [1.0, 1.0])
    shapes = replace(field, obstacles=Obstacles.joined([field.obstacles, block, behind]))
    shortest_path(shapes)
    shapes.obstacles.gradient(shapes.start)
