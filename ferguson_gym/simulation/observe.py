"""Observations from given states of a flight, without an environment."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ferguson_gym.simulation.observations import Layout, Observation, entries_of, write_observation
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.ways import observe_way
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.transition import State


@lru_cache(maxsize=16)
def _layout(settings: Settings) -> Layout:
    """The layout of some settings, kept, since making it takes longer than an observation."""
    return settings.layout


def observe_one(field: Field, vehicle: State, settings: Settings) -> Observation:
    """The observation (size,) by entry of a single vehicle; otherwise as `observe`."""
    return {name: rows[0] for name, rows in observe(field, [vehicle], settings).items()}


def observe(field: Field, vehicles: Sequence[State], settings: Settings) -> Observation:
    """Observations (n, size) by entry, of n vehicles, as an environment gives them.

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar.
    """
    discs = planar_discs(field)
    layout, most = _layout(settings), settings.segments or field.limits.segments
    sizes, count = layout.entries(), len(vehicles)
    flat = np.empty(count * sum(sizes.values()), np.float32)
    columns = np.ascontiguousarray(discs.centers.T)
    work, found = np.empty((2, len(discs))), np.empty(len(discs), np.int64)
    position, derivative = np.empty(2), np.empty(2)
    for i, vehicle in enumerate(vehicles):
        # copied, since another kernel would be compiled for read-only memory
        position[:], derivative[:] = vehicle.position, vehicle.derivative
        write_observation(
            flat,
            i,
            count,
            layout,
            position,
            derivative,
            1.0 - vehicle.segments / most,
            field.limits.unit,
            field.goal,
            field.bounds,
            columns,
            discs.radii,
            work,
            found,
        )
    entries = entries_of(flat, sizes, count)
    if layout.way:
        positions = np.array([vehicle.position for vehicle in vehicles]).reshape(count, 2)
        derivatives = np.array([vehicle.derivative for vehicle in vehicles]).reshape(count, 2)
        entries["way"][:] = observe_way(field, positions, derivatives, settings, layout)
    return entries
