"""Simulation of N vehicles: what the scalar and the vector environment are built on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import SPIN_LIMIT, HelperThreads, new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.drawn_fields import (
    DrawnFields,
    Given,
    by_settings,
    given_field,
    put_given,
)
from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.observations import FlatObservation
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import (
    DISABLED,
    Flags,
    Integers,
    Records,
    as_plain_tuple,
    make_buffers,
    write_rules,
)
from ferguson_gym.simulation.ways import Ways
from ferguson_gym.world.actions import Action, check_action
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import FLOWN, State

FIRST_BLOCK, BLOCK = 64, 256
"""Seeds of later resets that are drawn at a time: the first time, when each may be a new field
whose discs must be drawn, and afterwards, when the number hardly matters."""
PIECE = 8
"""Fields that are made at a time of seeds that were drawn before: few, for copies that are soon
thrown away."""
EMPTY = BLOCK + 1
"""`next` in the queue of a vehicle for which nothing was drawn yet."""
MANY = 64
"""Number of vehicles from which on threads share the work."""
ROOM = 16_384
"""Drawn fields for which there is room from the beginning."""
SOURCES = 8
"""Sources of drawn fields that are kept beside those in use."""

NOT_STARTED = -1
"""The outcome before the first reset."""

_COPIED = ("observations", "reports", "final_observations", "final_reports")
"""Buffers that a copy holds as they are."""


class BatchSimulator:
    """N vehicles, each in a field of its own.

    The field store has a slot for each vehicle, for fields that were asked for. Behind them are
    the fields that resets draw, in the order in which they are drawn for the first time.

    A copy, by pickle or by deepcopy, holds the flights and the seeds of fields that are still to be
    flown, but no drawn fields; it makes them again as its vehicles need them.
    """

    def __init__(self, settings: Settings, number: int, mode: int) -> None:
        each = [settings] * number
        room = min(settings.number, ROOM)
        self._make(each, mode, room, settings.max_obstacles, settings.max_segments)

    def _make(
        self, settings: list[Settings], mode: int, room: int, capacity: int, segments: int
    ) -> None:
        number = len(settings)
        self.settings, self.number = settings, number
        corners = max(one.max_corners for one, _ in by_settings(enumerate(settings)))
        self._store = FieldStore(number + room, capacity, corners)
        self._drawn = DrawnFields(self._store, number)
        self._buffers = make_buffers(
            settings[0], number, self._store.arrays, mode, BLOCK, longest=segments
        )
        flights = self._buffers.flights
        flights["outcome"], flights["next"] = NOT_STARTED, EMPTY
        self._plain_buffers = as_plain_tuple(self._buffers)
        self._given: list[Given | None] = [None] * number
        # seeds that were drawn, of fields that are not made yet; they come before the queue
        self._pending: dict[int, Integers] = {}
        self._all = np.ones(number, np.bool_)
        self._counters = new_counters()
        self._helpers: HelperThreads | None = None
        first = settings[0]  # arguments that shape ways are the same for all
        self._ways = Ways(first, number, self._field_in) if first.uses_ways else None

    @property
    def outcome(self) -> NDArray[np.int64]:
        """Codes of outcomes (N,), or NOT_STARTED; a flight that has not ended has FLYING."""
        return self._buffers.flights["outcome"]

    def ensure_capacity(self, field: Field) -> None:
        """Make room for as many obstacles, and corners of them, as this field has.

        Raises:
            ValueError: a field that is not planar.
        """
        self._store.ensure_capacity(field)
        self._use_arrays()

    def _use_arrays(self, **replaced: Any) -> None:
        """Step on with the store's arrays, if these are other ones, and with replaced buffers."""
        if self._buffers.fields is self._store.arrays and not replaced:
            return
        self._buffers = self._buffers._replace(fields=self._store.arrays, **replaced)
        self._plain_buffers = as_plain_tuple(self._buffers)
        # which may still look for work on the old buffers, by the old counters
        self._helpers, self._counters = None, new_counters()

    def change(self, changes: Mapping[int, Settings]) -> None:
        """Give vehicles other settings, of the same observations, from their next flight on.

        Seeds that were drawn stay, unless they are drawn from another number of fields or pool.
        """
        flights, longest = self._buffers.flights, self._buffers.paths.shape[1] - 1
        for i, new in changes.items():
            old, self.settings[i] = self.settings[i], new
            write_rules(self._buffers.rules[i], new)
            longest = max(longest, new.max_segments)
            if new.source == old.source or flights["next"][i] == EMPTY:
                continue
            if new.fields == old.fields:
                self._postpone(i)
            else:
                flights["next"][i] = EMPTY
                self._pending.pop(i, None)
        every = [new for new, _ in by_settings(changes.items())]
        capacity = max((new.max_obstacles for new in every), default=0)
        self._store.make_room(0, capacity, max((new.max_corners for new in every), default=0))
        self._make_room_for(longest)
        self._use_arrays()
        if self._drawn.sources > SOURCES + len({one.source for one in set(self.settings)}):
            self._forget()

    def _make_room_for(self, segments: int) -> None:
        """Make room for flights of so many segments."""
        old = self._buffers.paths
        if segments >= old.shape[1]:
            paths = np.zeros((self.number, segments + 1, 4, 2))
            paths[:, : old.shape[1]] = old
            self._use_arrays(paths=paths)

    def _upcoming(self, i: int) -> Integers:
        """Seeds of the fields that a vehicle flies next, as far as they are drawn."""
        slots = self._buffers.queue[i, self._buffers.flights["next"][i] :].tolist()
        queued = np.array([self._drawn.origin(slot)[1] for slot in slots], np.int64)
        return np.concatenate([queued, self._pending.get(i, queued[:0])])

    def _postpone(self, i: int) -> None:
        """Make the fields in a vehicle's queue later."""
        self._pending[i] = self._upcoming(i)
        self._buffers.flights["next"][i] = BLOCK

    def _forget(self) -> None:
        """Forget all drawn fields but those that are being flown, which move to vehicles' slots."""
        flights = self._buffers.flights
        for i in np.flatnonzero(flights["next"] <= BLOCK).tolist():
            self._postpone(i)
        for i in np.flatnonzero(flights["slot"] >= self.number).tolist():
            slot = int(flights["slot"][i])
            self._given[i], flights["slot"][i] = self._drawn.origin(slot), i
            self._store.move(slot, i)
        self._drawn.clear()
        if self._ways is not None:
            self._ways.forget(0)

    def reset(
        self,
        chosen: Flags,
        fields: Sequence[Field | int | None],
        streams: Sequence[np.random.Generator],
        renewed: Flags,
        changes: Mapping[int, Settings] | None = None,
    ) -> None:
        """Start flights; `observations` and `reports` are written for all vehicles.

        Args:
            chosen: (N,) vehicles that start.
            fields: for each a field, the seed of one, or None to draw the next from its stream.
            streams: (N,) random streams from which the seeds of later fields are drawn.
            renewed: (N,) streams that were seeded again; seeds drawn from them before are dropped.
            changes: new settings of vehicles, as for `change`.

        Raises:
            ValueError: a field that is not planar or has more obstacles than the capacity; nothing
                has changed.
        """
        which = np.flatnonzero(chosen).tolist()
        asked_for = [i for i in which if fields[i] is not None]
        for i in asked_for:
            if isinstance(field := fields[i], Field):
                self._store.check(field)
        if changes:
            self.change(changes)
        flights = self._buffers.flights
        flights["next"][renewed] = EMPTY
        for i in np.flatnonzero(renewed).tolist() if self._pending else ():
            self._pending.pop(i, None)
        drawn = chosen.copy()
        drawn[asked_for] = False
        if self._buffers.mode != DISABLED or drawn.any():
            self._prepare(which)
        self._draw_ahead(drawn, streams)
        given: dict[int, Given] = {}
        for i in which:
            if (field := fields[i]) is None:
                flights["slot"][i] = self._buffers.queue[i, flights["next"][i]]
                flights["next"][i] += 1
            else:
                given[i] = field if isinstance(field, Field) else (self.settings[i], field)
        self._put(given)
        self._use_arrays()
        step_kernel.reset(self._plain_buffers, chosen)
        if self._ways is not None:
            self._ways.begin(self._buffers)

    def _put(self, given: Mapping[int, Given]) -> None:
        """Write fields into vehicles' slots."""
        for i, one in given.items():
            if isinstance(one, Field):
                self._make_room_for(one.limits.segments)
            self._given[i], self._buffers.flights["slot"][i] = one, i
            if self._ways is not None:
                self._ways.forget(i, i + 1)
        put_given(self._store, given)

    def _prepare(self, which: Sequence[int]) -> None:
        """Make all fields of a suite if vehicles soon need most: later steps need not wait."""
        for settings, part in by_settings((i, self.settings[i]) for i in which):
            if len(part) * FIRST_BLOCK >= settings.number and settings.scattered is not None:
                self._drawn.slots(settings, np.arange(settings.number))

    def step(self, actions: Action, streams: Sequence[np.random.Generator]) -> None:
        """Fly one action (4,) of each vehicle.

        Raises:
            ValueError: actions that are not finite or outside [-1, 1].
        """
        if (invalid := step_kernel.first_invalid(actions)) >= 0:
            where = f" (environment {invalid})" if self.number > 1 else ""
            check_action(actions[invalid], where)
        if self._buffers.mode != DISABLED and step_kernel.used_up(self._buffers.flights, BLOCK):
            # before the step, so that an interrupted step leaves no queue empty
            self._draw_ahead(self._all, streams)
        self._buffers.actions[:] = actions
        before = self._buffers.flights.copy() if self._ways is not None else None
        if self.number >= MANY:
            if self._helpers is None:
                self._helpers = self._start_helpers()
            self._helpers.wake()
        step_kernel.advance(self._plain_buffers, self._counters, step_kernel.FROM_FRONT, 0)
        if self._ways is not None and before is not None:
            self._ways.step(before, self._buffers)

    def __getstate__(self) -> dict[str, Any]:
        """The flights and what they fly next; neither drawn fields nor threads."""
        buffers, flights = self._buffers, self._buffers.flights
        flown = np.arange(buffers.paths.shape[1]) <= flights["segments"][:, None]
        begun = range(self.number) if flights["outcome"][0] != NOT_STARTED else ()
        return {
            "settings": self.settings,
            "mode": buffers.mode,
            "capacity": self._store.capacity,
            "longest": buffers.paths.shape[1] - 1,
            "flights": flights,
            "paths": buffers.paths[flown],
            "given": {i: self._flown(i) for i in begun},
            "upcoming": {
                i: self._upcoming(i).astype(np.int32)
                for i in np.flatnonzero(flights["next"] <= BLOCK).tolist()
            },
            **{name: getattr(buffers, name) for name in _COPIED},
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Go on as the original; fields are made again from their seeds."""
        settings = list(state["settings"])
        self._make(settings, state["mode"], PIECE, state["capacity"], state["longest"])
        buffers, flights = self._buffers, self._buffers.flights
        flights[:] = state["flights"]
        flown = np.arange(buffers.paths.shape[1]) <= flights["segments"][:, None]
        buffers.paths[flown] = state["paths"]
        for name in _COPIED:
            getattr(buffers, name)[:] = state[name]
        for i, one in enumerate(settings):
            write_rules(buffers.rules[i], one)
        self._put(state["given"])
        self._use_arrays()
        for i, seeds in state["upcoming"].items():
            self._pending[i], flights["next"][i] = seeds.astype(np.int64), BLOCK
        if self._ways is not None and state["given"]:
            self._ways.begin(self._buffers)

    def _start_helpers(self) -> HelperThreads:
        # locals, since threads that referred to `self` would keep it alive
        buffers, counters = self._plain_buffers, self._counters
        threads = min(numba.get_num_threads(), self.number // step_kernel.CHUNK)
        return HelperThreads(
            lambda: step_kernel.advance(buffers, counters, step_kernel.FROM_BACK, SPIN_LIMIT),
            threads - 1,
        )

    def _draw_ahead(self, chosen: Flags, streams: Sequence[np.random.Generator]) -> None:
        """Fill the queue of each chosen vehicle that has used it up; fields are made together."""
        flights = self._buffers.flights
        empty = np.flatnonzero(chosen & (flights["next"] >= BLOCK)).tolist()
        pieces = {i: self._next_seeds(i, streams[i]) for i in empty}
        for settings, part in by_settings((i, self.settings[i]) for i in empty):
            slots = self._drawn.slots(settings, np.concatenate([pieces[i] for i in part]))
            for i in part:
                size = len(pieces[i])
                self._buffers.queue[i, BLOCK - size :], slots = slots[:size], slots[size:]
                flights["next"][i] = BLOCK - size
                self._pending[i] = self._pending[i][size:]
                if not len(self._pending[i]):
                    del self._pending[i]
        self._use_arrays()

    def _next_seeds(self, i: int, stream: np.random.Generator) -> Integers:
        """Seeds for the empty queue of a vehicle, pending until their fields are made.

        Seeds that were drawn before come first, a few at a time; then a block is drawn.
        """
        waiting = self._pending.get(i)
        if waiting is not None and len(waiting):
            return waiting[:PIECE]
        nexts = self._buffers.flights["next"]
        size = FIRST_BLOCK if nexts[i] == EMPTY else BLOCK
        seeds: Integers = stream.integers(self.settings[i].number, size=size)
        self._pending[i], nexts[i] = seeds, BLOCK
        return seeds

    @property
    def observations(self) -> FlatObservation:
        """Observations (N n,), entry after entry; the next step overwrites them."""
        return self._buffers.observations

    @property
    def reports(self) -> Records:
        """Reward, flags and infos (N,) of the last step or reset; the next one overwrites them."""
        return self._buffers.reports

    @property
    def final(self) -> tuple[FlatObservation, Records]:
        """In SAME_STEP, last observations and infos of flights that ended in the last step."""
        return self._buffers.final_observations, self._buffers.final_reports

    def _flown(self, i: int) -> Given:
        """What a vehicle flies through."""
        return self._given_in(int(self._buffers.flights["slot"][i]))

    def _given_in(self, slot: int) -> Given:
        given = self._given[slot] if slot < self.number else self._drawn.origin(slot)
        assert given is not None
        return given

    def _field_in(self, slot: int) -> Field:
        return given_field(self._given_in(slot))

    def field(self, i: int) -> Field:
        """The field in which a vehicle flies."""
        field, flight = given_field(self._flown(i)), self._buffers.flights[i]
        rules = {"gate": float(flight["gate"]), "segments": int(flight["most"])}
        if all(getattr(field.limits, name) == value for name, value in rules.items()):
            return field
        return field.with_limits(**rules)

    def state(self, i: int) -> State:
        """A vehicle's state in double precision."""
        flight = self._buffers.flights[i]
        return State(
            flight["position"].copy(), flight["derivative"].copy(), int(flight["segments"])
        )

    def control(self, i: int) -> Array:
        """Segments (n, 4, 2) that a vehicle has flown."""
        return self._buffers.paths[i, : self._buffers.flights[i]["segments"]].copy()

    def refused(self, i: int) -> Array | None:
        """The segment (4, 2) that was refused and so ended a flight, if one was."""
        flight = self._buffers.flights[i]
        if flight["outcome"] == NOT_STARTED:
            return None
        if Outcome.from_code(int(flight["outcome"])) in FLOWN:
            return None
        control: Array = self._buffers.paths[i, flight["segments"]].copy()
        return control
