"""Slots of the fields that resets draw: each field is made once, when it is drawn first."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import Integers
from ferguson_gym.world.field import Field


class DrawnFields:
    """Drawn fields in the slots of a store behind the first few.

    Args:
        store: where the fields are written; it grows as needed.
        first: number of slots at its front that belong to others.
    """

    def __init__(self, store: FieldStore, first: int) -> None:
        self._store, self._first = store, first
        self._slots: dict[Hashable, Integers] = {}  # by source, then by seed; 0 is no drawn field's
        self._settings: list[Settings] = []
        self.seeds: list[int] = []
        """Seeds of the fields by slot, from `first` on."""

    @property
    def sources(self) -> int:
        """Number of sources, such as a suite with some radii, of which there are fields."""
        return len(self._slots)

    def slots(self, settings: Settings, seeds: Integers) -> Integers:
        """Slots (n,) of the fields that some settings give seeds (n,) below `settings.number`."""
        known = self._slots.get(settings.source)
        if known is None:
            known = self._slots[settings.source] = np.zeros(settings.number, np.int64)
        slots: Integers = known[seeds]
        if slots.all():
            return slots
        for seed in seeds[slots == 0].tolist():
            if known[seed] == 0:
                known[seed] = self._draw(settings, seed)
        drawn: Integers = known[seeds]
        return drawn

    def _draw(self, settings: Settings, seed: int) -> int:
        slot = self._first + len(self.seeds)
        self._store.make_room(slot + 1)
        put(self._store, slot, settings, seed)
        self.seeds.append(seed)
        self._settings.append(settings)
        return slot

    def origin(self, slot: int) -> tuple[Settings, int]:
        """Settings and seed of the field in a slot."""
        return self._settings[slot - self._first], self.seeds[slot - self._first]

    def clear(self) -> None:
        """Forget all fields, so that their slots can be used again."""
        self._slots.clear()
        self._settings.clear()
        self.seeds.clear()
        self._store.used = self._first


def put(store: FieldStore, slot: int, settings: Settings, seed: int) -> None:
    """Write the field that some settings give a seed into a slot."""
    if settings.pool is None:  # without a `Field`, whose checks a suite's fields pass
        store.put_obstacles(slot, settings.drawn(seed))
    else:
        store.put(slot, settings.field(seed))


def given_field(given: Field | tuple[Settings, int]) -> Field:
    """A field that was kept as itself or as settings and a seed."""
    return given if isinstance(given, Field) else given[0].field(given[1])
