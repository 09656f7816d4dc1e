"""Fields that are moved, scaled, mirrored and turned copies of others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.world import Field, Obstacles


@dataclass(frozen=True, slots=True)
class Motion:
    """The map y = scale (turn x) + shift, with `turn` a rotation or reflection (2, 2)."""

    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    turn: tuple[tuple[float, float], tuple[float, float]] = ((1.0, 0.0), (0.0, 1.0))

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Images of points (..., 2)."""
        return self.scale * (points @ np.array(self.turn).T) + np.array(self.shift)

    def vectors(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Images of vectors (..., 2)."""
        return self.scale * (vectors @ np.array(self.turn).T)

    def field(self, field: Field) -> Field:
        """The image of a field, with its limits."""
        every = field.obstacles
        images = [self.points(every.core(k)) for k in range(len(every))]
        corners = self.points(field.bounds)
        return Field(
            name=field.name,
            obstacles=Obstacles.discs(self.points(every.centers), self.scale * every.radii)
            if every.are_discs
            else Obstacles.hulls(images, self.scale * every.radii),
            start=self.points(field.start),
            goal=self.points(field.goal),
            bounds=np.stack([corners.min(axis=0), corners.max(axis=0)]),
            start_derivative=self.vectors(field.departure),
            limits={"longest": self.scale * field.limits.longest},
        )


MOTIONS = {
    "millimetres": Motion(scale=1e-3),
    "ten kilometres": Motion(scale=1e4),
    "feet": Motion(scale=0.3048),
    "far away": Motion(shift=(1e6, -1e6)),
    "mirrored": Motion(turn=((-1.0, 0.0), (0.0, 1.0))),
    "turned": Motion(turn=((0.0, -1.0), (1.0, 0.0))),
    "turned and mirrored": Motion(turn=((0.0, 1.0), (1.0, 0.0))),
}
