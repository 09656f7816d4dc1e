"""The shortest clear polyline through some points of another one, by dynamic programming."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.scene import Scene
from planners.whole_path.line_of_sight import lines_clear


def shortcut(scene: Scene, points: Array) -> Array:
    """The points (m, 2) of the shortest clear polyline through points (n, 2) in their order [m].

    The given polyline is assumed to be clear, n >= 1; its ends are kept. Corners can only be at the
    given points, so the result is usually longer than the taut path.
    """
    n = len(points)
    togo, after = np.zeros(n), np.arange(1, n + 1)
    for k in range(n - 2, -1, -1):
        ahead = points[k + 1 :]
        way = np.linalg.norm(ahead - points[k], axis=1) + togo[k + 1 :]
        clear = lines_clear(scene, points[k], ahead)
        clear[0] = True
        best = int(np.argmin(np.where(clear, way, np.inf)))
        togo[k], after[k] = way[best], k + 1 + best
    kept = [0]
    while kept[-1] < n - 1:
        kept.append(int(after[kept[-1]]))
    return points[kept]
