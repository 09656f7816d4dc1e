"""Random fields of obstacles of every shape, and how deep routes run into them."""

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles


def mixed_field(seed: int, number: int = 30, scale: float = 1.0) -> Field:
    """Discs, walls, blocks, rounded blocks and slivers in turn; start and goal keep 1 m of room.

    Sizes are multiples of `scale`; at 1 shapes are 2 to 16 m long, and many overlap.
    """
    stream = np.random.default_rng(seed)
    parts = [
        _shape(kind % 5, stream.uniform(0.0, 100.0, 2), scale, stream) for kind in range(number)
    ]
    every = Obstacles.joined(parts)
    room = every.signed_distance(np.array([[0.0, 0.0], [100.0, 100.0]])).min(axis=0)
    return Field(name=f"mixed {seed}", obstacles=every.only(room > 1.0))


def _shape(kind: int, middle: np.ndarray, scale: float, stream: np.random.Generator) -> Obstacles:
    turn = stream.uniform(0.0, np.pi)
    along = np.array([np.cos(turn), np.sin(turn)])
    half = scale * stream.uniform(1.0, 8.0, (2, 1)) * [along, [-along[1], along[0]]]
    block = [middle + a * half[0] + b * half[1] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    match kind:
        case 0:
            return Obstacles.discs([middle], [scale * stream.uniform(1.0, 6.0)])
        case 1:
            return Obstacles.capsules([[middle - half[0], middle + half[0]]], 0.2 * scale)
        case 2:
            return Obstacles.polygons([block])
        case 3:
            return Obstacles.polygons([block], stream.uniform(0.5, 2.0) * scale)
        case _:
            return Obstacles.polygons([[middle, middle + half[0], middle + 0.1 * half[1]]])


def depth_of_lines(starts: np.ndarray, ends: np.ndarray, field: Field) -> np.ndarray:
    """How deep lines (n, 2) run into obstacles or out of the bounds (n,) [m], negative outside.

    Certified, so at least as deep as it is, by less than 1e-7 m in fields of 120 m.
    """
    way = ends - starts
    within = -field.obstacles.clearance(np.stack([starts, ends, way, way], axis=1))
    both = np.stack([starts, ends])
    outside = np.maximum(field.bounds[0] - both, both - field.bounds[1]).max(axis=(0, 2))
    return np.maximum(within, outside)
