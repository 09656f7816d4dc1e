"""Slots of the fields that resets draw: each field is made once, at the latest when it is drawn."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import TypeAlias

import numpy as np

from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import Integers
from ferguson_gym.world.field import Field
from ferguson_gym.world.suites import stream_keys

Given: TypeAlias = Field | tuple[Settings, int]
"""A field, or the settings and the seed that make it."""


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
        new = np.unique(seeds[slots == 0])
        begin = self._first + len(self.seeds)
        made = np.arange(begin, begin + len(new))
        self._store.make_room(begin + len(new))
        _put(self._store, made, settings, new)
        known[new] = made
        self.seeds += new.tolist()
        self._settings += [settings] * len(new)
        drawn: Integers = known[seeds]
        return drawn

    def origin(self, slot: int) -> tuple[Settings, int]:
        """Settings and seed of the field in a slot."""
        return self._settings[slot - self._first], self.seeds[slot - self._first]

    def clear(self) -> None:
        """Forget all fields, so that their slots can be used again."""
        self._slots.clear()
        self._settings.clear()
        self.seeds.clear()
        self._store.used = self._first


def _put(store: FieldStore, slots: Integers, settings: Settings, seeds: Integers) -> None:
    """Write the fields that some settings give seeds (n,) into slots (n,)."""
    if settings.pool is not None:
        for slot, seed in zip(slots.tolist(), seeds.tolist(), strict=True):
            store.put(slot, settings.field(seed))
    elif (recipe := settings.scattered) is not None:
        store.put_discs(slots, recipe, stream_keys(settings.suite, settings.split, seeds))
    else:  # without a `Field`, whose checks a suite's fields pass
        for slot, seed in zip(slots.tolist(), seeds.tolist(), strict=True):
            store.put_obstacles(slot, settings.drawn(seed))


def put_given(store: FieldStore, given: Mapping[int, Given]) -> None:
    """Write fields, by slot."""
    seeds: dict[int, tuple[Settings, int]] = {}
    for slot, one in given.items():
        if isinstance(one, Field):
            store.put(slot, one)
        else:
            seeds[slot] = one
    for settings, part in by_settings((slot, one) for slot, (one, _) in seeds.items()):
        _put(store, np.array(part), settings, np.array([seeds[slot][1] for slot in part]))


def given_field(given: Given) -> Field:
    """A field that was kept as itself or as settings and a seed."""
    return given if isinstance(given, Field) else given[0].field(given[1])


def by_settings(vehicles: Iterable[tuple[int, Settings]]) -> list[tuple[Settings, list[int]]]:
    """Vehicles grouped by the object that holds their settings.

    To compare settings would take long where they name many fields.
    """
    groups: dict[int, tuple[Settings, list[int]]] = {}
    for i, settings in vehicles:
        groups.setdefault(id(settings), (settings, []))[1].append(i)
    return list(groups.values())
