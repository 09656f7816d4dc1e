"""Similarity: a field moved and scaled so that its numbers are those of the paper's fields.

Nothing in the mathematics of flights knows metres. Planners and optimisers do know lengths, such as
strides and tolerances; they are written for fields whose start is the origin and whose longest
segment is 15 m. Any other field is mapped to such a field, and what is found there is mapped back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LONGEST
from ferguson_gym.world.transition import State


@dataclass(frozen=True, slots=True, eq=False)
class Similarity:
    """The map y = scale (x - origin) of points, and y = scale x of vectors and lengths."""

    field: Field
    """The field that is mapped."""
    scale: float
    """Length in the image of a length of 1 m: the inverse of the limits' unit."""
    image: Field
    """The field in the image: its start is the origin, its longest segment is 15 m."""

    @property
    def origin(self) -> Array:
        """The point (D,) that is mapped to the origin [m]."""
        return self.field.start

    def points(self, points: Array) -> Array:
        """Points (*batch, D) in the image."""
        return self.scale * (points - self.origin)

    def points_back(self, points: Array) -> Array:
        """Points (*batch, D) [m] of the image's points; the image's goal becomes the goal."""
        back = points / self.scale + self.origin
        back[(points == self.image.goal).all(axis=-1)] = self.field.goal
        return back

    def control(self, control: Array) -> Array:
        """Segments (*batch, 4, D) in the image."""
        return np.concatenate(
            [self.points(control[..., :2, :]), self.scale * control[..., 2:, :]], axis=-2
        )

    def control_back(self, control: Array) -> Array:
        """Segments (*batch, 4, D) of the image's segments."""
        return np.concatenate(
            [self.points_back(control[..., :2, :]), control[..., 2:, :] / self.scale], axis=-2
        )

    def state(self, state: State) -> State:
        """A vehicle's state in the image; on the goal, it is on the image's goal."""
        return State(self.points(state.position), self.scale * state.derivative, state.segments)


@lru_cache(maxsize=8)
def similarity(field: Field) -> Similarity | None:
    """The similarity of a field, cached by the field's identity; None if it is its own image."""
    limits = field.limits
    if limits.longest == PAPER_LONGEST and not field.start.any():
        return None
    scale = 1.0 / limits.unit
    image = replace(
        field,
        obstacles=field.obstacles.rescaled(field.start, scale),
        start=np.zeros_like(field.start),
        goal=scale * (field.goal - field.start),
        bounds=scale * (field.bounds - field.start),
        start_derivative=scale * field.departure,
        limits=replace(
            limits,
            longest=PAPER_LONGEST,
            shortest=scale * limits.shortest,
            slowest=scale * limits.slowest,
            gate=scale * limits.gate,
            tolerance=scale * limits.tolerance,
        ),
    )
    return Similarity(field, scale, image)
