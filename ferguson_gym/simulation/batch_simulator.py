"""Simulation of N vehicles: what the scalar and the vector environment are built on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import SPIN_LIMIT, HelperThreads, new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.observations import FlatObservation
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import (
    DISABLED,
    Flags,
    Records,
    as_plain_tuple,
    make_buffers,
)
from ferguson_gym.world.actions import Action, check_action
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import FLOWN, State

FIRST_BLOCK, BLOCK = 64, 256
"""Seeds of later resets that are drawn at a time: the first time, when each may be a new field
whose discs must be drawn, and afterwards, when the number hardly matters."""
EMPTY = BLOCK + 1
"""`next` in the queue of a vehicle for which nothing was drawn yet."""
MANY = 64
"""Number of vehicles from which on threads share the work."""

NOT_STARTED = -1
"""The outcome before the first reset."""


class BatchSimulator:
    """N vehicles, each in a field of its own.

    The field store has a slot for each vehicle, for fields that were asked for. Behind them it has
    a slot for each of the `settings.fields` seeds from which later resets draw; these are filled
    in the order in which seeds are drawn for the first time.
    """

    def __init__(self, settings: Settings, number: int, mode: int) -> None:
        self.settings, self.number = settings, number
        self._store = FieldStore(number + settings.fields, settings.max_obstacles)
        self._buffers = make_buffers(settings, number, self._store.arrays, mode, BLOCK)
        flights = self._buffers.flights
        flights["outcome"], flights["next"] = NOT_STARTED, EMPTY
        self._plain_buffers = as_plain_tuple(self._buffers)
        self._given_fields: list[Field | None] = [None] * number
        self._drawn_seeds: list[int] = []
        self._slot_of = np.zeros(settings.fields, np.int64)  # 0, a vehicle's slot: not drawn yet
        self._all = np.ones(number, np.bool_)
        self._counters = new_counters()
        self._helpers: HelperThreads | None = None

    @property
    def outcome(self) -> NDArray[np.int64]:
        """Codes of outcomes (N,), or NOT_STARTED; a flight that has not ended has FLYING."""
        return self._buffers.flights["outcome"]

    def ensure_capacity(self, field: Field) -> None:
        """Make room for as many obstacles as this field has.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar.
        """
        self._store.ensure_capacity(field)
        self._buffers = self._buffers._replace(fields=self._store.arrays)
        self._plain_buffers = as_plain_tuple(self._buffers)
        self._helpers = None  # which step the old buffers

    def reset(
        self,
        chosen: Flags,
        fields: Sequence[Field | int | None],
        streams: Sequence[np.random.Generator],
        renewed: Flags,
    ) -> None:
        """Start flights; `observations` and `reports` are written for all vehicles.

        Args:
            chosen: (N,) vehicles that start.
            fields: for each a field, the seed of one, or None to draw the next from its stream.
            streams: (N,) random streams from which the seeds of later fields are drawn.
            renewed: (N,) streams that were seeded again; seeds drawn from them before are dropped.

        Raises:
            TypeError: obstacles other than discs.
            ValueError: a field that is not planar or has more obstacles than the capacity. In
                either case nothing has changed.
        """
        flights, which = self._buffers.flights, np.flatnonzero(chosen).tolist()
        asked_for = {}
        for i in which:
            if (field := fields[i]) is not None:
                asked_for[i] = field if isinstance(field, Field) else self.settings.field(field)
                self._store.check(asked_for[i])
        flights["next"][renewed] = EMPTY
        drawn = chosen.copy()
        drawn[list(asked_for)] = False
        self._draw_ahead(drawn, streams)
        for i in which:
            if i in asked_for:
                self._store.put(i, asked_for[i])
                self._given_fields[i], flights["slot"][i] = asked_for[i], i
            else:
                flights["slot"][i] = self._buffers.queue[i, flights["next"][i]]
                flights["next"][i] += 1
        step_kernel.reset(self._plain_buffers, chosen)

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
        if self.number >= MANY:
            if self._helpers is None:
                self._helpers = self._start_helpers()
            self._helpers.wake()
        step_kernel.advance(self._plain_buffers, self._counters)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but threads; a copy starts its own."""
        return self.__dict__ | {"_helpers": None}

    def _start_helpers(self) -> HelperThreads:
        # locals, since threads that referred to `self` would keep it alive
        buffers, counters = self._plain_buffers, self._counters
        threads = min(numba.get_num_threads(), self.number // step_kernel.CHUNK)
        return HelperThreads(
            lambda: step_kernel.help_out(buffers, counters, step_kernel.FROM_BACK, SPIN_LIMIT),
            threads - 1,
        )

    def _draw_ahead(self, chosen: Flags, streams: Sequence[np.random.Generator]) -> None:
        """Draw a block of seeds for each chosen vehicle whose queue is used up."""
        flights = self._buffers.flights
        for i in np.flatnonzero(chosen & (flights["next"] >= BLOCK)).tolist():
            size = FIRST_BLOCK if flights["next"][i] == EMPTY else BLOCK
            seeds = streams[i].integers(self.settings.fields, size=size)
            slots = self._slot_of[seeds]
            if not slots.all():
                self._store_fields(seeds[slots == 0].tolist())
                slots = self._slot_of[seeds]
            self._buffers.queue[i, BLOCK - size :], flights["next"][i] = slots, BLOCK - size

    def _store_fields(self, seeds: list[int]) -> None:
        """Draw the discs of seeds that have no slot yet."""
        for seed in seeds:
            if self._slot_of[seed] == 0:
                slot = self.number + len(self._drawn_seeds)
                self._store.put_discs(slot, self.settings.discs(seed))
                self._drawn_seeds.append(seed)
                self._slot_of[seed] = slot

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

    def field(self, i: int) -> Field:
        """The field in which a vehicle flies."""
        slot = int(self._buffers.flights["slot"][i])
        given = self._given_fields[slot] if slot < self.number else None
        return given or self.settings.field(self._drawn_seeds[slot - self.number])

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
