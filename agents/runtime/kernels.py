"""Compiles all kernels in advance, by a flight through a small field."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ferguson_gym.environment import ObstacleField
from ferguson_gym.shortest_paths import exact_length, shortest_path
from ferguson_gym.world import Field, Obstacles


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
    exact_length(field)
    field.obstacles.closest([[0.0, 0.0], [9.0, 0.0], [9.0, 0.0], [9.0, 0.0]])
    # what discs do not need; the path follows an edge
    block = Obstacles.polygons([[[19.0, 25.0], [15.0, 21.0], [21.0, 15.0], [25.0, 19.0]]])
    shapes = replace(field, obstacles=Obstacles.joined([field.obstacles, block]))
    shortest_path(shapes)
    shapes.obstacles.gradient(shapes.start)
