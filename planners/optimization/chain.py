"""Conversion between chains of segments and vectors of unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array, GenericArray


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Knots (n + 1, 2, D), rows point [m] and derivative [m per unit t], some of them free.

    The unknowns x are the free numbers in this order; for the paper's window, all but the
    first knot: P1, P1', P2, P2', P3, P3', twelve in the plane.

    Reference:
        The paper, section III-C1.
    """

    knots: Array
    """Values of the fixed numbers; those of free numbers are ignored."""
    free: NDArray[np.bool_]
    """Which numbers the solver moves."""

    @classmethod
    def from_state(cls, position: Array, derivative: Array, segments: int) -> Chain:
        """A chain that starts in a state, all later knots free."""
        knots = np.zeros((segments + 1, 2, len(position)))
        knots[0] = position, derivative
        free = np.ones(knots.shape, dtype=np.bool_)
        free[0] = False
        return cls(knots, free)

    def ending_at(self, goal: Array) -> Chain:
        """The same chain with its last point fixed at the goal."""
        knots, free = self.knots.copy(), self.free.copy()
        knots[-1, 0], free[-1, 0] = goal, False
        return Chain(knots, free)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.knots) - 1

    def control(self, x: GenericArray) -> GenericArray:
        """Segments (n, 4, D) for unknowns x, real or complex."""
        knots = self.knots.astype(x.dtype)
        knots[self.free] = x
        return np.stack([knots[:-1, 0], knots[1:, 0], knots[:-1, 1], knots[1:, 1]], axis=1)

    def unknowns(self, control: Array) -> Array:
        """The unknowns x of segments (n, 4, D); fixed numbers are ignored."""
        knots = np.empty(self.knots.shape)
        knots[0] = control[0, 0], control[0, 2]
        knots[1:, 0], knots[1:, 1] = control[:, 1], control[:, 3]
        return knots[self.free]

    def chain_rule(self, rows: Array, segment: NDArray[np.intp]) -> Array:
        """Gradients with respect to x (m, unknowns) by the chain rule.

        Args:
            rows: (m, 4, D) gradients, each with respect to the control array of one segment.
            segment: (m,) that segment's index.
        """
        whole, index = np.zeros((len(rows), *self.knots.shape)), np.arange(len(rows))
        whole[index, segment] = rows[:, 0::2]
        whole[index, segment + 1] = rows[:, 1::2]
        return whole[:, self.free]

    def bounds(self, low: Array, high: Array, steepest: float) -> tuple[Array, Array]:
        """Box for x: points between `low` and `high` (D,) [m], derivatives within +-steepest."""
        least, most = np.empty(self.knots.shape), np.empty(self.knots.shape)
        least[:, 0], most[:, 0] = low, high
        least[:, 1], most[:, 1] = -steepest, steepest
        return least[self.free], most[self.free]
