"""The way as observations show it and as rewards measure progress along it.

The compiled step knows nothing of ways: they are written behind its observations, which come last
in the order of entries, and rewards are computed again where progress is measured along the way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from weakref import WeakMethod

import numpy as np

from ferguson_gym.guidance.tree_pool import TreePool
from ferguson_gym.guidance.way import Way, tree_of, with_margin
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.simulation.observations import FlatObservation, Layout
from ferguson_gym.simulation.reward import segment_reward
from ferguson_gym.simulation.settings import WAY, Settings
from ferguson_gym.simulation.step_buffers import SAME_STEP, Integers, Records, StepBuffers
from ferguson_gym.world.actions import heading
from ferguson_gym.world.feasibility import FLYING
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LONGEST
from ferguson_gym.world.outcome import Outcome

_UNKNOWN, _NONE = -2, -1
"""Instead of the number of a slot's tree: not made yet, and none among so many discs."""
_UNUSED = 64
"""Trees of fields that are flown no more, which are kept beside as many as are in use."""
_GOAL_REACHED = Outcome.GOAL_REACHED.code


def distances_along(layout: Layout) -> Array:
    """Distances (1, n) along the way at which its points are shown [units of the field]."""
    return layout.max_range * np.arange(1, layout.way + 1)[None] / max(layout.way, 1)


@compiled
def write_rows(
    rows: FlatObservation,
    places: Array,
    togo: Array,
    positions: Array,
    derivatives: Array,
    view: Array,
    bounds: Array,
) -> None:
    """Write the entries `way` (m, 2 n + 2) of m vehicles, as the environment's docstring says.

    Args:
        rows: filled.
        places: (m, n, 2) points ahead [m].
        togo: (m,) distances to go [m].
        positions: (m, 2) [m].
        derivatives: (m, 2) [m per unit t].
        view: (m,) range of the observation [m].
        bounds: (m, 2, 2) lower and upper ones [m].
    """
    points = places.shape[1]
    for i in range(len(rows)):
        turn = heading(derivatives[i, 0], derivatives[i, 1])
        for k in range(points):
            x = (places[i, k, 0] - positions[i, 0]) / view[i]
            y = (places[i, k, 1] - positions[i, 1]) / view[i]
            rows[i, 2 * k] = min(max(turn.real * x + turn.imag * y, -1.0), 1.0)
            rows[i, 2 * k + 1] = min(max(turn.real * y - turn.imag * x, -1.0), 1.0)
        rows[i, 2 * points] = min(togo[i] / view[i], 1.0)
        wide, high = bounds[i, 1, 0] - bounds[i, 0, 0], bounds[i, 1, 1] - bounds[i, 0, 1]
        diagonal = np.sqrt(wide * wide + high * high)
        rows[i, 2 * points + 1] = min(0.5 * togo[i] / diagonal, 1.0)


@lru_cache(maxsize=2)
def _way(field: Field, margin: float) -> Way:
    return Way(field, margin)


def observe_way(
    field: Field, positions: Array, derivatives: Array, settings: Settings, layout: Layout
) -> FlatObservation:
    """Entries `way` (m, 2 n + 2) of vehicles in one field at positions (m, 2) with derivatives."""
    rows = np.empty((len(positions), 2 * layout.way + 2), np.float32)
    places, togo = _way(field, float(settings.margin)).ahead(positions, distances_along(layout))
    view = np.full(len(rows), layout.max_range * field.limits.unit)
    bounds = np.repeat(field.bounds[None], len(rows), axis=0)
    write_rows(rows, places, togo, positions, derivatives, view, bounds)
    return rows


class Ways:
    """The ways of N vehicles, each in a field of its own, which a slot of a store holds.

    Args:
        settings: of the environment.
        number: N.
        field: a method that returns the field in a slot, of an object that outlives this one.
    """

    def __init__(self, settings: Settings, number: int, field: Callable[[int], Field]) -> None:
        self._settings, self._layout = settings, settings.layout
        # a reference to the owner would keep its memory and threads until garbage is collected
        self._weak_field = WeakMethod(field)
        self._distances = distances_along(self._layout)
        self._pool = TreePool()
        self._trees, self._lengths = np.full(0, _UNKNOWN), np.full(0, np.nan)
        # by slot, where the tree of paths with margins does not suffice; those used last come last
        self._others: dict[int, Way] = {}
        self._togo, self._whole = np.zeros(number), np.zeros(number)

    def _field(self, slot: int) -> Field:
        field = self._weak_field()
        assert field is not None
        return field(slot)

    def forget(self, first: int, end: int | None = None) -> None:
        """Forget what is known of slots whose fields change, from a first one up to an end."""
        self._trees[first:end], self._lengths[first:end] = _UNKNOWN, np.nan
        end = len(self._trees) if end is None else end
        self._others = {k: way for k, way in self._others.items() if not first <= k < end}

    def begin(self, buffers: StepBuffers) -> None:
        """Write what all vehicles are shown after a reset, or in copied flights."""
        self._show(buffers)
        if self._settings.progress == WAY:
            slots = buffers.flights["slot"]
            starts = buffers.fields.records["start"][slots]
            self._whole = self.ahead(slots, starts, self._distances)[1]

    def step(self, before: Records, buffers: StepBuffers) -> None:
        """Write what all vehicles are shown after a step, and rewards along the way.

        Args:
            before: (N,) of FLIGHT, copied before the step.
            buffers: as the step left them.
        """
        after, old, whole = buffers.flights, self._togo, self._whole
        ended = np.flatnonzero(buffers.reports["terminated"] | buffers.reports["truncated"])
        self._show(buffers)
        new = self._togo
        if buffers.mode == SAME_STEP and len(ended):
            after, new = after.copy(), new.copy()
            after[ended] = _last(before[ended], buffers, ended)
            new[ended] = self.write(buffers.final_observations, buffers, after[ended], ended)
            if self._settings.reference:
                buffers.final_reports["shortest"] = 0.0
                buffers.final_reports["shortest"][ended] = self._shortest(before["slot"][ended])
        if self._settings.progress == WAY:
            self._whole = np.where(buffers.flights["segments"] == 0, self._togo, whole)
            flown = (before["outcome"] == FLYING) & (after["segments"] > before["segments"])
            which = np.flatnonzero(flown & np.isfinite(old + new + whole))
            _reward_along(buffers.reports, which, before, after, old, new, whole)

    def _show(self, buffers: StepBuffers) -> None:
        everyone = np.arange(len(buffers.flights))
        self._togo = self.write(buffers.observations, buffers, buffers.flights, everyone)
        if self._settings.reference:
            buffers.reports["shortest"] = self._shortest(buffers.flights["slot"])

    def write(
        self, observations: FlatObservation, buffers: StepBuffers, flights: Records, which: Integers
    ) -> Array:
        """Write ways of vehicles (m,) in states of FLIGHT (m,); returns distances to go (m,)."""
        if not self._layout.way and self._settings.progress != WAY:
            return np.zeros(len(flights))
        records, slots = buffers.fields.records, flights["slot"]
        positions = np.ascontiguousarray(flights["position"])
        places, togo = self.ahead(slots, positions, self._distances)
        if self._layout.way:
            rows = np.empty((len(slots), 2 * self._layout.way + 2), np.float32)
            unit, bounds = records["longest"][slots] / PAPER_LONGEST, records["bounds"][slots]
            derivatives = np.ascontiguousarray(flights["derivative"])
            view = self._layout.max_range * unit
            write_rows(rows, places, togo, positions, derivatives, view, bounds)
            size = rows.shape[1] * len(buffers.flights)
            observations[len(observations) - size :].reshape(-1, rows.shape[1])[which] = rows
        return togo

    def ahead(self, slots: Integers, points: Array, distances: Array) -> tuple[Array, Array]:
        """Points ahead (m, n, 2) and distances to go (m,) in slots (m,), as `Way.ahead`."""
        self._make_room(slots)
        if (self._trees[slots] == _UNKNOWN).any():
            self._forget_unused()
            for slot in np.unique(slots[self._trees[slots] == _UNKNOWN]).tolist():
                tree = tree_of(with_margin(self._field(slot), self._settings.margin))
                self._trees[slot] = _NONE if tree is None else self._pool.add(tree)
        places, togo = self._pool.look_ahead(self._trees[slots], points, distances)
        for i in np.flatnonzero(np.isinf(togo)).tolist():
            row = distances[i : i + 1] if len(distances) > 1 else distances
            shown = self._other(int(slots[i])).ahead(points[i : i + 1], row)
            places[i : i + 1], togo[i : i + 1] = shown
        return places, togo

    def _forget_unused(self) -> None:
        """Forget all trees if most belong to no field any more, or if they take much memory.

        As many are made again as there are vehicles, so that this is not done at every reset.
        """
        pool, number = self._pool, len(self._togo)
        used = np.count_nonzero(self._trees >= 0)
        if len(pool) > 2 * used + _UNUSED or (pool.is_full and len(pool) > 2 * number):
            pool.clear()
            self._trees[:] = _UNKNOWN

    def _other(self, slot: int) -> Way:
        """The way in a slot's field by other means than its tree of paths with margins."""
        way = self._others.pop(slot, None)
        if way is None:
            way = Way(self._field(slot), self._settings.margin)
            if len(self._others) >= 2 * len(self._togo):
                del self._others[next(iter(self._others))]
        self._others[slot] = way
        return way

    def _shortest(self, slots: Integers) -> Array:
        """Lengths (m,) of the shortest paths of the fields in slots (m,) [m]; infinite for none."""
        self._make_room(slots)
        for slot in np.unique(slots[np.isnan(self._lengths[slots])]).tolist():
            length = exact_length(self._field(slot))
            self._lengths[slot] = np.inf if length is None else length
        return self._lengths[slots]

    def _make_room(self, slots: Integers) -> None:
        if int(slots.max(initial=0)) >= len(self._trees):
            more = max(int(slots.max()) + 1 - len(self._trees), len(self._trees))
            self._trees = np.concatenate([self._trees, np.full(more, _UNKNOWN)])
            self._lengths = np.concatenate([self._lengths, np.full(more, np.nan)])


def _last(before: Records, buffers: StepBuffers, ended: Integers) -> Records:
    """States of FLIGHT (m,) in which flights ended in a step that has also reset them."""
    last, final = before.copy(), buffers.final_reports[ended]
    for key in ("segments", "path_length", "outcome"):
        last[key] = final[key]
    flown = final["segments"] > before["segments"]
    control = buffers.paths[ended, before["segments"]][flown]
    last["position"][flown], last["derivative"][flown] = control[:, 1], control[:, 3]
    return last


@compiled
def _reward_along(
    reports: Records,
    which: Integers,
    before: Records,
    after: Records,
    old: Array,
    new: Array,
    whole: Array,
) -> None:
    """Reward segments that were flown by their progress along the way.

    Args:
        reports: (N,) whose rewards are written.
        which: (m,) vehicles that flew a segment.
        before: (N,) of FLIGHT, before the segment.
        after: (N,) of FLIGHT, after it.
        old: (N,) distances to go before it [m].
        new: (N,) distances to go after it [m].
        whole: (N,) distances to go from the start [m].
    """
    for i in which:
        length = after[i].path_length - before[i].path_length
        reward = segment_reward(old[i], new[i], length, whole[i], before[i].detour)
        if after[i].outcome not in (FLYING, _GOAL_REACHED):
            reward -= before[i].failure
        reports[i].reward = reward
