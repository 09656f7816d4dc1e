"""Fields laid out for compiled functions: a slot for each vehicle, and a store of drawn ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.obstacles import Discs

PLACE = np.dtype(
    [
        ("start", np.float64, 2),
        ("departure", np.float64, 2),
        ("goal", np.float64, 2),
        ("bounds", np.float64, (2, 2)),
        ("distance", np.float64),
        ("clearance", np.float64),
    ]
)
"""What a field has beside obstacles: start [m], start derivative [m per unit t], goal, bounds,
the straight distance from start to goal and the clearance at the start [m]."""


class FieldArrays(NamedTuple):
    """Fields by slot."""

    places: NDArray[np.void]
    """(slots,) of PLACE."""
    discs: Array
    """Rows x, y, radius (slots, 3, M) [m]; a radius of minus infinity where there is no disc."""


class FieldStore:
    """Holds fields of at most M = `capacity` discs.

    Slots behind the last that was filled take no memory: the system provides zeros on first use.
    """

    def __init__(self, slots: int, capacity: int) -> None:
        self.capacity = capacity
        self._usual = Field(name="usual", obstacles=Discs(np.empty((0, 2)), np.empty(0)))
        self.world = FieldArrays(
            places=np.zeros(slots, PLACE),
            discs=np.zeros((slots, 3, max(capacity, 1))),
        )
        self.used = 0
        """Slots up to the last that was filled."""

    def make_room(self, field: Field) -> None:
        """Let fields have as many discs as this one.

        Raises:
            TypeError, ValueError: as `check`, but for the number of discs.
        """
        capacity = len(planar_discs(field))
        old = self.world.discs
        if capacity > old.shape[2]:
            used = slice(self.used)
            discs = np.zeros((*old.shape[:2], capacity))
            discs[used, 2] = -np.inf
            discs[used, :, : old.shape[2]] = old[used]
            self.world = self.world._replace(discs=discs)
        self.capacity = max(self.capacity, capacity)

    def check(self, field: Field) -> None:
        """Refuse what has no place.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar, or with more discs than fit.
        """
        if (number := len(planar_discs(field))) > self.capacity:
            raise ValueError(
                f"field {field.name} has {number} obstacles, the environment holds at most "
                f"{self.capacity}: make it with capacity={number} or more"
            )

    def put(self, slot: int, field: Field) -> None:
        """Lay out a field that was checked."""
        assert isinstance(field.obstacles, Discs)
        self._put(slot, field, field.obstacles)

    def put_discs(self, slot: int, discs: Discs) -> None:
        """Lay out a field of discs with the usual start, goal and bounds."""
        self._put(slot, self._usual, discs)

    def _put(self, slot: int, field: Field, discs: Discs) -> None:
        world = self.world
        for key in ("start", "departure", "goal", "bounds", "distance"):
            world.places[key][slot] = getattr(field, key)
        away = discs.signed_distance(field.start)
        world.places["clearance"][slot] = np.min(away, initial=np.inf)
        world.discs[slot, :2, : len(discs)] = discs.centers.T
        world.discs[slot, 2, : len(discs)] = discs.radii
        world.discs[slot, 2, len(discs) :] = -np.inf
        self.used = max(self.used, slot + 1)
