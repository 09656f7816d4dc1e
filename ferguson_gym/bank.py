"""Fields laid out for compiled functions: a slot for each vehicle, and a store of drawn ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.obstacles import Discs

PLACE = np.dtype(
    [
        ("start", np.float64, 2),
        ("departure", np.float64, 2),
        ("goal", np.float64, 2),
        ("bounds", np.float64, (2, 2)),
        ("distance", np.float64),
    ]
)
"""What a field has beside obstacles: start [m], start derivative [m per unit t], goal, bounds
and the straight distance from start to goal [m]."""


class World(NamedTuple):
    """Fields by slot."""

    places: NDArray[np.void]
    """(slots,) of PLACE."""
    columns: Array
    """Centres (slots, 2, M) [m]."""
    radii: Array
    """(slots, M) [m]; minus infinity where there is no disc."""


class Bank:
    """Holds fields of at most M = `capacity` discs; start, goal and bounds are the usual ones."""

    def __init__(self, slots: int, capacity: int) -> None:
        self.capacity = capacity
        common = Field(name="without obstacles", obstacles=Discs(np.empty((0, 2)), np.empty(0)))
        self.world = World(
            places=np.empty(slots, PLACE),
            columns=np.zeros((slots, 2, max(capacity, 1))),
            radii=np.full((slots, max(capacity, 1)), -np.inf),
        )
        self._place(slice(None), common)
        self.held: NDArray[np.bool_] = np.zeros(slots, np.bool_)
        """Slots that hold a field."""

    def grow(self, capacity: int) -> None:
        """Make room for more discs in each field."""
        more = capacity - self.world.radii.shape[1]
        if more > 0:
            self.world = self.world._replace(
                columns=np.pad(self.world.columns, ((0, 0), (0, 0), (0, more))),
                radii=np.pad(self.world.radii, ((0, 0), (0, more)), constant_values=-np.inf),
            )
        self.capacity = max(self.capacity, capacity)

    def check(self, field: Field) -> None:
        """Refuse what has no place.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar, or with more discs than fit.
        """
        discs = field.obstacles
        if not isinstance(discs, Discs):
            raise TypeError(f"the environment knows discs only, not {type(discs).__name__}")
        if discs.dimension != 2:
            raise ValueError(
                f"flights are planar, field {field.name} has {discs.dimension} dimensions"
            )
        if len(discs) > self.capacity:
            raise ValueError(
                f"field {field.name} has {len(discs)} obstacles, the environment holds at most "
                f"{self.capacity}: make it with capacity={len(discs)} or more"
            )

    def put(self, slot: int, field: Field) -> None:
        """Lay out a field that was checked."""
        assert isinstance(field.obstacles, Discs)
        self._place(slot, field)
        self.put_discs(slot, field.obstacles)

    def _place(self, slot: int | slice, field: Field) -> None:
        places = self.world.places
        for key in ("start", "departure", "goal", "bounds", "distance"):
            places[key][slot] = getattr(field, key)

    def put_discs(self, slot: int, discs: Discs) -> None:
        """Lay out discs alone, where the rest is in place already."""
        world = self.world
        world.columns[slot, :, : len(discs)] = discs.centers.T
        world.radii[slot, : len(discs)] = discs.radii
        world.radii[slot, len(discs) :] = -np.inf
        self.held[slot] = True
