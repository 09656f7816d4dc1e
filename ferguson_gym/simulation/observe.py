"""Observations from given states of a flight, without an environment."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.simulation.observations import (
    FlatObservation,
    Layout,
    Observation,
    entries_of,
    write_observation,
)
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.ways import observe_way
from ferguson_gym.world.field import Field, planar_obstacles
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
        ValueError: a field that is not planar.
    """
    obstacles = planar_obstacles(field)
    centers, radii = obstacles.balls
    layout, most = _layout(settings), settings.segments or field.limits.segments
    sizes, count = layout.entries(), len(vehicles)
    flat = np.empty(count * sum(sizes.values()), np.float32)
    positions = np.array([vehicle.position for vehicle in vehicles]).reshape(count, 2)
    derivatives = np.array([vehicle.derivative for vehicle in vehicles]).reshape(count, 2)
    _write(
        flat,
        layout,
        positions,
        derivatives,
        1.0 - np.array([vehicle.segments for vehicle in vehicles], np.float64) / most,
        field.limits.unit,
        field.goal,
        field.bounds,
        np.ascontiguousarray(centers.T),
        radii,
        obstacles.cores,
    )
    entries = entries_of(flat, sizes, count)
    if layout.way:
        entries["way"][:] = observe_way(field, positions, derivatives, settings, layout)
    return entries


@compiled
def _write(
    flat: FlatObservation,
    layout: Layout,
    positions: Array,
    derivatives: Array,
    remaining: Array,
    unit: float,
    goal: Array,
    bounds: Array,
    columns: Array,
    radii: Array,
    cores: Cores,
) -> None:
    """Write the observations (m n,) of m vehicles in one field; see `write_observation`."""
    work, found = np.empty((2, len(radii))), np.empty(len(radii), np.int64)
    for i in range(len(positions)):
        write_observation(
            flat,
            i,
            len(positions),
            layout,
            positions[i],
            derivatives[i],
            remaining[i],
            unit,
            goal,
            bounds,
            columns,
            radii,
            cores,
            work,
            found,
        )
