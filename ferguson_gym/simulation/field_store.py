"""Fields as arrays of fixed shape for compiled functions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.world.field import Field, planar_obstacles
from ferguson_gym.world.field_pool import corners_of
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.recipes.mersenne_twister import Words
from ferguson_gym.world.suites import Scattered

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


Integers = NDArray[np.int64]


class FieldArrays(NamedTuple):
    """Fields by slot."""

    records: NDArray[np.void]
    """(slots,) of FIELD_RECORD."""
    discs: Array
    """Rows x, y, radius (slots, 3, M) [m] of the balls that bound the obstacles, discs themselves;
    a radius of minus infinity where there is no obstacle."""
    corners: Array
    """(slots, 2, C) of the obstacles' cores [m]; C is 0 as long as all obstacles are discs."""
    first: Integers
    """(slots, M + 1) index of the first corner of each core, and of the end of the last; (slots, 0)
    where C is 0."""
    radii: Array
    """(slots, M) by which the cores are grown [m]; (slots, 0) where C is 0."""


@compiled_in_place
def cores_of(fields: FieldArrays, slot: int) -> Cores:
    """The cores of the field in a slot."""
    return Cores(fields.corners[slot], fields.first[slot], fields.radii[slot])


class FieldStore:
    """Holds fields of at most M = `capacity` obstacles in numbered slots.

    Slots beyond the last filled one take no memory, since the operating system provides zeros on
    first use. When the slots, the capacity or the room for corners no longer suffice, `arrays` are
    replaced.

    Args:
        slots: number of slots at first.
        capacity: M.
        corners: of the cores of a field, other than of discs alone, for which there is room.
    """

    def __init__(self, slots: int, capacity: int, corners: int = 0) -> None:
        self.capacity = capacity
        self._default = _record(
            Field(name="default", obstacles=Obstacles.discs(np.empty((0, 2)), np.empty(0)))
        )
        self.arrays = _empty(slots, max(capacity, 1), corners)
        self.used = 0
        """Number of slots up to the last filled one."""

    def ensure_capacity(self, field: Field) -> None:
        """Raise the capacity to the number of obstacles of this field, and of their corners.

        Raises:
            ValueError: a field that is not planar.
        """
        obstacles = planar_obstacles(field)
        self.make_room(0, len(obstacles), corners_of(obstacles))

    def make_room(self, slots: int, capacity: int = 0, corners: int = 0) -> None:
        """Provide at least so many slots, for so many obstacles and corners of other than discs."""
        old, used = self.arrays, self.used
        self.capacity = max(self.capacity, capacity)
        most, room = max(self.capacity, old.discs.shape[2]), old.corners.shape[2]
        if slots <= len(old.records) and most <= old.discs.shape[2] and corners <= room:
            return
        # doubled, so that a field is seldom copied
        number = max(slots, 2 * len(old.records)) if slots > len(old.records) else len(old.records)
        if corners > room > 0:
            corners = max(corners, 2 * room)
        new = _empty(number, most, max(corners, room))
        new.records[:used] = old.records[:used]
        new.discs[:used, 2] = -np.inf
        new.discs[:used, :, : old.discs.shape[2]] = old.discs[:used]
        if room:
            new.corners[:used, :, :room] = old.corners[:used]
            new.first[:used, : old.first.shape[1]] = old.first[:used]
            new.radii[:used, : old.radii.shape[1]] = old.radii[:used]
        elif corners:  # discs have kept no cores so far
            width = min(most, new.corners.shape[2])
            new.corners[:used, :, :width] = new.discs[:used, :2, :width]
            new.first[:used] = np.arange(new.first.shape[1])
            new.radii[:used] = new.discs[:used, 2]
        self.arrays = new

    def move(self, source: int, slot: int) -> None:
        """Copy a field into another slot."""
        for array in self.arrays:
            array[slot] = array[source]

    def check(self, field: Field) -> None:
        """Refuse a field that the store cannot hold.

        Raises:
            ValueError: a field that is not planar, or with more obstacles than fit.
        """
        if (number := len(planar_obstacles(field))) > self.capacity:
            raise ValueError(
                f"field {field.name} has {number} obstacles, the environment holds at most "
                f"{self.capacity}: make it with capacity={number} or more"
            )

    def put(self, slot: int, field: Field) -> None:
        """Write a field, already checked, into a slot."""
        self.make_room(0, 0, corners_of(field.obstacles))
        self._put(slot, _record(field), field.obstacles)

    def put_obstacles(self, slot: int, obstacles: Obstacles) -> None:
        """Write a field with the default start, goal and bounds into a slot."""
        self.make_room(0, 0, corners_of(obstacles))
        self._put(slot, self._default, obstacles)

    def put_discs(self, slots: Integers, recipe: Scattered, keys: Words) -> None:
        """Write the fields that a recipe draws into slots (n,), as `put_obstacles` would.

        Args:
            slots: for which there is room, different ones.
            recipe: which draws them.
            keys: (n, 4) of the streams from which they are drawn.
        """
        arrays, number = self.arrays, recipe.most
        recipe.draw_many(keys, slots, arrays.discs)
        arrays.records[slots] = self._default
        _complete(arrays, slots, number)
        if arrays.corners.shape[2]:
            arrays.corners[slots, :, :number] = arrays.discs[slots, :2, :number]
            arrays.first[slots] = np.minimum(np.arange(arrays.first.shape[1]), number)
            arrays.radii[slots, :number] = arrays.discs[slots, 2, :number]
        self.used = max(self.used, int(slots.max(initial=-1)) + 1)

    def _put(self, slot: int, record: NDArray[np.void], obstacles: Obstacles) -> None:
        arrays, number = self.arrays, len(obstacles)
        centers, radii = obstacles.balls
        arrays.records[slot] = record
        distances = obstacles.signed_distance(record["start"])
        arrays.records["clearance"][slot] = np.min(distances, initial=np.inf)
        arrays.discs[slot, :2, :number] = centers.T
        arrays.discs[slot, 2, :number] = radii
        arrays.discs[slot, 2, number:] = -np.inf
        if arrays.corners.shape[2]:
            arrays.corners[slot, :, : len(obstacles.points)] = obstacles.points.T
            arrays.first[slot, : number + 1] = obstacles.starts
            arrays.first[slot, number + 1 :] = obstacles.starts[-1]
            arrays.radii[slot, :number] = obstacles.radii
        self.used = max(self.used, slot + 1)


def _record(field: Field) -> NDArray[np.void]:
    """The record () of a field, without the clearance."""
    record = np.zeros((), FIELD_RECORD)
    for key in ("start", "start_derivative", "goal", "bounds", "distance"):
        record[key] = getattr(field, key)
    for key, limit in field.limits.numbers()._asdict().items():
        record[key] = limit
    return record


@compiled
def _complete(fields: FieldArrays, slots: Integers, number: int) -> None:
    """Write clearances of fields with so many discs, and that there are no others."""
    for slot in slots:
        record, discs = fields.records[slot], fields.discs[slot]
        least = np.inf
        for i in range(number):
            x, y = record.start[0] - discs[0, i], record.start[1] - discs[1, i]
            least = min(least, np.sqrt(x * x + y * y) - discs[2, i])
        record.clearance = least
        discs[2, number:] = -np.inf


def _empty(slots: int, capacity: int, corners: int) -> FieldArrays:
    # discs keep no cores; a store with other obstacles has room for those of discs, too
    corners = max(corners, capacity) if corners else 0
    most = capacity if corners else 0
    return FieldArrays(
        records=np.zeros(slots, FIELD_RECORD),
        discs=np.zeros((slots, 3, capacity)),
        corners=np.zeros((slots, 2, corners)),
        first=np.zeros((slots, most + 1 if corners else 0), np.int64),
        radii=np.zeros((slots, most)),
    )
