"""Line of sight: whether straight lines through a field are clear."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.departures import point_view
from ferguson_gym.shortest_paths.tangents import Records, Scene, View, is_clear, scene
from ferguson_gym.world.field import Field


def scene_from(field: Field, position: Array) -> Scene | None:
    """The obstacles and bounds of lines from a vehicle; None if the vehicle itself collides.

    The vehicle (2,) may violate discs or bounds by at most the field's tolerance; then lines from
    it may violate them by the same amount, since a flight may touch obstacles and must be able to
    leave them.

    Raises:
        TypeError: obstacles other than discs in the plane.
    """
    world, _ = scene(field)
    free, discs = point_view(world, float(position[0]), float(position[1]), field.limits.tolerance)
    if not free:
        return None
    low, high = world.box
    box = np.stack([np.minimum(low, position), np.maximum(high, position)])
    return world._replace(discs=discs, box=box)


def lines_clear(scene: Scene, starts: ArrayLike, ends: ArrayLike) -> NDArray[np.bool_]:
    """Whether straight lines enter no disc and stay inside the bounds: (n,).

    Starts and ends are (n, 2) each, or (2,) for all lines [m]; a line may have length zero. Exact
    up to the margin of `ferguson_gym.shortest_paths.tangents`, as shortest paths are.
    """
    lines = np.array(np.broadcast_arrays(np.atleast_2d(starts), np.atleast_2d(ends)), np.float64)
    return _are_clear(scene, lines[0], lines[1])


@compiled
def _are_clear(scene: Scene, starts: Array, ends: Array) -> NDArray[np.bool_]:
    discs, box = scene.discs, scene.box
    clear = np.zeros(len(starts), dtype=np.bool_)
    for k in range(len(starts)):
        x, y = starts[k]
        end_x, end_y = ends[k]
        inside = box[0, 0] <= min(x, end_x) and max(x, end_x) <= box[1, 0]
        inside = inside and box[0, 1] <= min(y, end_y) and max(y, end_y) <= box[1, 1]
        clear[k] = inside and keeps_clear(x, y, end_x, end_y, discs)
    return clear


@compiled
def keeps_clear(x: float, y: float, end_x: float, end_y: float, discs: Records) -> bool:
    """Whether no point of a line from (x, y) is nearer to a disc's centre than its reach [m].

    A line of length zero is a point.
    """
    every = View(np.arange(len(discs)), np.full(len(discs), -np.inf))
    dx, dy = end_x - x, end_y - y
    length = np.sqrt(dx * dx + dy * dy)
    ux, uy = (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)
    return is_clear(x, y, ux, uy, length, np.inf, discs, every, -1, -1)
