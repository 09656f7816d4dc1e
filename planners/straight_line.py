"""One straight line at a time, for libraries that ask about every line by a call to Python."""

from __future__ import annotations

import numpy as np

from ferguson_gym.compilation import compiled
from planners.tangents import Records, View, is_clear


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
