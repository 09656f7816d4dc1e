"""Random obstacles of every shape, and windows among them."""

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.optimization.initial_guesses import random_chains
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window

SHAPES = ("polygons", "rounded", "capsules", "discs")


def random_shapes(
    stream: np.random.Generator,
    number: int,
    bounds: tuple[float, float] = (0.0, 100.0),
    kinds: tuple[str, ...] = SHAPES,
    sizes: tuple[float, float] = (1.0, 8.0),
) -> Obstacles:
    """Convex polygons, the same with rounded corners, capsules and discs, about in equal parts."""
    parts = []
    for _ in range(number):
        kind, size = kinds[stream.integers(len(kinds))], stream.uniform(*sizes)
        middle, corners = stream.uniform(*bounds, 2), int(stream.integers(3, 9))
        angle = np.sort(stream.uniform(0.0, 2.0 * np.pi, corners))
        around = size * np.column_stack([np.cos(angle), np.sin(angle)])
        around *= stream.uniform(0.2, 1.0, (1, 2))
        match kind:
            case "polygons":
                parts.append(Obstacles.polygons([middle + around]))
            case "rounded":
                parts.append(Obstacles.polygons([middle + around], 0.3 * size))
            case "capsules":
                ends = middle + size * np.array([[1.0, -1.0]]).T * around[:1] / size
                parts.append(Obstacles.capsules([ends], stream.uniform(0.05, 0.5) * size))
            case _:
                parts.append(Obstacles.discs([middle], [size]))
    return Obstacles.joined(parts)


def random_shape_field(
    stream: np.random.Generator, number: int, kinds: tuple[str, ...] = SHAPES
) -> Field:
    """A field of random shapes, none of them on the start or the goal."""
    obstacles = random_shapes(stream, number, kinds=kinds)
    start, goal = stream.uniform(-5.0, 105.0, (2, 2))
    clear = obstacles.signed_distance(np.stack([start, goal])).min(axis=0) >= 0.0
    return Field(name="shapes", obstacles=obstacles.only(clear), start=start, goal=goal)


def window_among_shapes(
    seed: int, number: int = 40, final: bool = False, kinds: tuple[str, ...] = SHAPES
) -> tuple[Window, np.ndarray]:
    """A window of three segments, and a random guess (3, 4, 2)."""
    stream = np.random.default_rng(seed)
    field = random_shape_field(stream, number, kinds)
    angle = stream.uniform(-np.pi, np.pi)
    vehicle = State(field.start, 5.0 * np.array([np.cos(angle), np.sin(angle)]))
    make = final_window if final else horizon_window
    window = make(field, vehicle, WindowSettings(), 3)
    (guess,) = random_chains(stream, vehicle, 3, PAPER_LIMITS, 1)
    return window, guess
