"""Fields as arrays of fixed shape for compiled functions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.obstacles import Discs

FIELD_RECORD = np.dtype(
    [
        ("start", np.float64, 2),
        ("start_derivative", np.float64, 2),
        ("goal", np.float64, 2),
        ("bounds", np.float64, (2, 2)),
        ("distance", np.float64),
        ("clearance", np.float64),
        ("shortest", np.float64),
        ("longest", np.float64),
        ("slowest", np.float64),
        ("gate", np.float64),
        ("tolerance", np.float64),
        ("segments", np.int64),
    ]
)
"""A field without its obstacles: start [m], start derivative [m per unit t], goal, bounds,
the straight distance from start to goal, the clearance at the start [m], and its limits."""


class FieldArrays(NamedTuple):
    """Fields by slot."""

    records: NDArray[np.void]
    """(slots,) of FIELD_RECORD."""
    discs: Array
    """Rows x, y, radius (slots, 3, M) [m]; a radius of minus infinity where there is no disc."""


class FieldStore:
    """Holds fields of at most M = `capacity` discs in numbered slots.

    Slots beyond the last filled one take no memory, since the operating system provides zeros on
    first use. When the slots or the capacity no longer suffice, `arrays` are replaced.
    """

    def __init__(self, slots: int, capacity: int) -> None:
        self.capacity = capacity
        self._default = Field(name="default", obstacles=Discs(np.empty((0, 2)), np.empty(0)))
        self.arrays = FieldArrays(
            records=np.zeros(slots, FIELD_RECORD),
            discs=np.zeros((slots, 3, max(capacity, 1))),
        )
        self.used = 0
        """Number of slots up to the last filled one."""

    def ensure_capacity(self, field: Field) -> None:
        """Raise the capacity to the number of discs of this field.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar.
        """
        self.make_room(0, len(planar_discs(field)))

    def make_room(self, slots: int, capacity: int = 0) -> None:
        """Provide at least so many slots, for at least so many discs each."""
        records, old = self.arrays
        self.capacity = max(self.capacity, capacity)
        if slots <= len(records) and self.capacity <= old.shape[2]:
            return
        if slots > len(records):  # doubled, so that a field is seldom copied
            slots, used = max(slots, 2 * len(records)), records[: self.used]
            records = np.zeros(slots, FIELD_RECORD)
            records[: self.used] = used
        discs = np.zeros((len(records), 3, max(self.capacity, old.shape[2])))
        discs[: self.used, 2] = -np.inf
        discs[: self.used, :, : old.shape[2]] = old[: self.used]
        self.arrays = FieldArrays(records, discs)

    def move(self, source: int, slot: int) -> None:
        """Copy a field into another slot."""
        self.arrays.records[slot] = self.arrays.records[source]
        self.arrays.discs[slot] = self.arrays.discs[source]

    def check(self, field: Field) -> None:
        """Refuse a field that the store cannot hold.

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
        """Write a field, already checked, into a slot."""
        assert isinstance(field.obstacles, Discs)
        self._put(slot, field, field.obstacles)

    def put_discs(self, slot: int, discs: Discs) -> None:
        """Write a field of discs with the default start, goal and bounds into a slot."""
        self._put(slot, self._default, discs)

    def _put(self, slot: int, field: Field, discs: Discs) -> None:
        arrays = self.arrays
        for key in ("start", "start_derivative", "goal", "bounds", "distance"):
            arrays.records[key][slot] = getattr(field, key)
        for key, limit in field.limits.numbers()._asdict().items():
            arrays.records[key][slot] = limit
        distances = discs.signed_distance(field.start)
        arrays.records["clearance"][slot] = np.min(distances, initial=np.inf)
        arrays.discs[slot, :2, : len(discs)] = discs.centers.T
        arrays.discs[slot, 2, : len(discs)] = discs.radii
        arrays.discs[slot, 2, len(discs) :] = -np.inf
        self.used = max(self.used, slot + 1)
