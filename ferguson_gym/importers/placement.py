"""Start, goal, bounds and limits of a field whose source has only obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from ferguson_gym.runtime.arrays import Array, finite
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LONGEST, Limits, check_names
from ferguson_gym.world.obstacles import Obstacles

PAPER_DISTANCE = 100.0 * 2.0**0.5
"""Distance from start to goal in the paper's fields [m]."""
_FEWEST = 4.0
"""Fields with a straight distance of fewer segments of the longest length than this are small."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Where start, goal and bounds are around obstacles, and the limits of segments.

    What is not given follows from the smallest box around all obstacles: the bounds lie `room`
    beyond its sides, the start half of that beyond its lower left corner, and the goal half of it
    beyond its upper right corner.

    Raises:
        ValueError: numbers that are not finite, a room that is not positive, an unknown limit.
    """

    start: Point | None = None
    """Start [m]."""
    goal: Point | None = None
    """Goal [m]."""
    bounds: tuple[float, float, float, float] | None = None
    """Least x, least y, greatest x and greatest y [m]."""
    room: float | None = None
    """Room around the obstacles [m]; None: the longest segment's length, or a tenth of the longer
    side of the box if that is less."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Limits that are not the default ones. Without a `longest`, segments in a small field, whose
    start and goal are less than 60 m apart, have the paper's share of that distance."""

    def __post_init__(self) -> None:
        for name in ("start", "goal"):
            if getattr(self, name) is not None:
                finite(name, getattr(self, name), (2,))
        if self.bounds is not None:
            finite("bounds", self.bounds, (4,))
        if self.room is not None and not finite("room", self.room, ()) > 0.0:
            raise ValueError(f"the room around obstacles must be above 0 m, got {self.room:g} m")
        check_names(self.limits)
        object.__setattr__(self, "limits", MappingProxyType(dict(self.limits)))

    def field(self, name: str, obstacles: Obstacles) -> Field:
        """The field that these obstacles make.

        Raises:
            ValueError: no obstacles to go by, or as `Field`: for example a start in an obstacle.
        """
        low, high = self._box(obstacles)
        longest = self.limits.get("longest", PAPER_LONGEST)
        room = min(longest, 0.1 * float((high - low).max())) if self.room is None else self.room
        start = low - 0.5 * room if self.start is None else np.array(self.start)
        goal = high + 0.5 * room if self.goal is None else np.array(self.goal)
        bounds = np.stack([np.minimum(low - room, start), np.maximum(high + room, goal)])
        if self.bounds is not None:
            bounds = np.reshape(self.bounds, (2, 2))
        distance = float(np.linalg.norm(goal - start))
        limits = dict(self.limits)
        if "longest" not in limits and distance < _FEWEST * PAPER_LONGEST:
            limits["longest"] = PAPER_LONGEST * distance / PAPER_DISTANCE or PAPER_LONGEST
        return Field(
            name=name,
            obstacles=obstacles,
            start=start,
            goal=goal,
            bounds=bounds,
            limits=Limits.of(limits),
        )

    def _box(self, obstacles: Obstacles) -> tuple[Array, Array]:
        """Lower and upper corner of what bounds follow from [m]."""
        if len(obstacles):
            reach = np.repeat(obstacles.radii, np.diff(obstacles.starts))[:, None]
            return (obstacles.points - reach).min(axis=0), (obstacles.points + reach).max(axis=0)
        given = [self.start, self.goal, None if self.bounds is None else self.bounds[:2]]
        if self.start is None or self.goal is None:
            raise ValueError("there are no obstacles, so start and goal must be given")
        points = np.array([point for point in given if point is not None])
        return points.min(axis=0), points.max(axis=0)
