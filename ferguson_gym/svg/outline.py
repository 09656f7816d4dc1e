"""The boundary of an obstacle, a convex core grown by a radius: arcs joined by straight lines."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array

_WIDEST = 2.0 * math.pi / 3.0
"""Widest arc, so that rounded coordinates determine its centre well."""
_TURN = math.pi / 36.0
"""Angle between neighbouring points of an arc."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Arcs of one radius in counter-clockwise order, each joined to the next by a straight line."""

    centers: Array
    """(k, 2) corners of the core, around which the arcs run [m]; a corner may have several."""
    angles: Array
    """(k, 2) at which each arc starts and ends, the second not below the first [rad]."""
    radius: float
    """Of all arcs [m]; 0 where the corners are sharp."""

    @property
    def arcs(self) -> Array:
        """Start and end of each arc (k, 2, 2) [m]."""
        return self._at(self.centers[:, None], self.angles)

    @property
    def points(self) -> Array:
        """Points (n, 2) that draw the outline as a closed polygon [m]."""
        if self.radius == 0.0:
            return self.centers
        return np.concatenate(
            [
                self._at(center, np.linspace(start, end, 1 + math.ceil((end - start) / _TURN)))
                for center, (start, end) in zip(self.centers, self.angles, strict=True)
            ]
        )

    def _at(self, centers: Array, angles: Array) -> Array:
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        points: Array = centers + self.radius * unit
        return points


def outline(core: Array, radius: float) -> Outline:
    """The outline of an obstacle.

    Args:
        core: (m, 2) its corners [m]: a point, a line, or a convex polygon counter-clockwise.
        radius: by which the core is grown [m].
    """
    if len(core) == 1:
        starts, sweeps = np.zeros(1), np.full(1, 2.0 * math.pi)
    else:
        edges = np.roll(core, -1, axis=0) - core
        outwards = np.arctan2(-edges[:, 0], edges[:, 1])
        # at each corner the outline turns from one edge's normal to the next one's
        starts, before = np.roll(outwards, 1), np.roll(edges, 1, axis=0)
        across = before[:, 0] * edges[:, 1] - before[:, 1] * edges[:, 0]
        sweeps = np.abs(np.arctan2(across, (before * edges).sum(axis=1)))
    parts = np.ones(len(core), np.int64)
    if radius > 0.0:
        parts = np.maximum(np.ceil(sweeps / _WIDEST - 1e-9).astype(np.int64), 1)
    corner = np.repeat(np.arange(len(core)), parts)
    part = np.arange(len(corner)) - np.repeat(np.cumsum(parts) - parts, parts)
    step = (sweeps / parts)[corner]
    start = starts[corner] + part * step
    return Outline(core[corner], np.stack([start, start + step], axis=1), radius)
