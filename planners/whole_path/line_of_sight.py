"""Line of sight: whether straight lines through a field are clear."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import point_view
from ferguson_gym.shortest_paths.scene import Scene, comes_within, scene
from ferguson_gym.shortest_paths.shapes import Integers, Records, Shapes, enters
from ferguson_gym.world.field import Field

Barriers: TypeAlias = tuple[Records, Integers, Records, Array, Array]
"""Obstacles of a scene: its discs; first corners, corners, radii and reach of its shapes."""


def scene_from(field: Field, position: Array) -> Scene | None:
    """The obstacles and bounds of lines from a vehicle; None if the vehicle itself collides.

    The vehicle (2,) may violate obstacles or bounds by at most the field's tolerance; then lines
    from it may violate them by the same amount, since a flight may touch obstacles and must be able
    to leave them.

    Raises:
        TypeError: a field that is not planar.
    """
    world, _ = scene(field)
    free, near = point_view(world, float(position[0]), float(position[1]), field.limits.tolerance)
    if not free:
        return None
    low, high = world.box
    box = np.stack([np.minimum(low, position), np.maximum(high, position)])
    return near._replace(box=box)


def lines_clear(scene: Scene, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
    """Whether straight lines enter no obstacle and stay inside the bounds: (n,).

    Starts and ends are (n, 2) each, or (2,) for all lines [m]; a line may have length zero. Exact
    up to the margin of `ferguson_gym.shortest_paths.scene`, as shortest paths are.
    """
    lines = np.array(np.broadcast_arrays(np.atleast_2d(starts), np.atleast_2d(ends)), np.float64)
    return _are_clear(scene, lines[0], lines[1])


@compiled
def _are_clear(scene: Scene, starts: Array, ends: Array) -> NDArray[np.bool_]:
    discs, box, (first, corners, radii, reach) = scene.discs, scene.box, scene.shapes
    clear = np.zeros(len(starts), dtype=np.bool_)
    for k in range(len(starts)):
        x, y = starts[k]
        end_x, end_y = ends[k]
        inside = box[0, 0] <= min(x, end_x) and max(x, end_x) <= box[1, 0]
        inside = inside and box[0, 1] <= min(y, end_y) and max(y, end_y) <= box[1, 1]
        clear[k] = inside and keeps_clear(x, y, end_x, end_y, discs, first, corners, radii, reach)
    return clear


@compiled
def keeps_clear(
    x: float,
    y: float,
    end_x: float,
    end_y: float,
    discs: Records,
    first: Integers,
    corners: Records,
    radii: Array,
    reach: Array,
) -> bool:
    """Whether a line from (x, y) enters no obstacle, wherever the bounds are.

    A line of length zero is a point. The other arguments are `Barriers`, one by one, since compiled
    functions take arrays faster than tuples.
    """
    dx, dy = end_x - x, end_y - y
    length = np.sqrt(dx * dx + dy * dy)
    ux, uy = (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)
    for k in range(len(discs)):
        if comes_within(discs[k].x - x, discs[k].y - y, discs[k].reach, ux, uy, length):
            if len(first) == 0 or first[k + 1] - first[k] == 1:
                return False
            if enters(x, y, ux, uy, length, Shapes(first, corners, radii, reach), k):
                return False
    return True
