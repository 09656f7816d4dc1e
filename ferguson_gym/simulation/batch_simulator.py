"""Vehicles under one set of settings: what the scalar and the vector environment share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import PATIENCE, HelperThreads, new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.observations import Single
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_kernel import Flags, Records
from ferguson_gym.world.actions import Action, check_action
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import FLOWN, State

FIRST, BLOCK = 64, 256
"""Seeds of later resets that are drawn at a time: the first time, when each may be a field that
is yet to be laid out, and then, when it takes as long whatever their number."""
VOID = BLOCK + 1
"""In place of the next in a vehicle's queue, where nothing was drawn from its stream."""
MANY = 64
"""From this many vehicles on, threads share the work."""

NOT_STARTED = -1
"""In place of an outcome, before the first reset."""


class BatchSimulator:
    """N vehicles, each in a field of its own.

    The bank holds a slot for each vehicle, for fields that were asked for, and behind them
    one for each of the `settings.fields` seeds that later resets draw from; those are filled
    one after the other, by seeds that are drawn for the first time.
    """

    def __init__(self, settings: Settings, number: int, mode: int) -> None:
        self.settings, self.number = settings, number
        self._bank = FieldStore(number + settings.fields, settings.most)
        flights = np.zeros(number, step_kernel.FLIGHT)
        flights["outcome"], flights["next"] = NOT_STARTED, VOID
        values = number * sum(settings.layout.entries().values())
        self._job = step_kernel.StepBuffers(
            flights=flights,
            paths=np.zeros((number, settings.segments + 1, 4, 2)),
            queue=np.zeros((number, BLOCK), np.int64),
            world=self._bank.world,
            actions=np.zeros((number, 4), np.float32),
            limits=settings.limits.numbers(),
            prices=settings.prices,
            layout=settings.layout,
            mode=mode,
            seen=np.zeros(values, np.float32),
            reports=np.zeros(number, step_kernel.REPORT),
            last_seen=np.zeros(values, np.float32),
            last_reports=np.zeros(number, step_kernel.REPORT),
        )
        self._bare = step_kernel.as_plain_tuple(self._job)
        self._given: list[Field | None] = [None] * number
        self._drawn: list[int] = []
        self._slot_of = np.zeros(settings.fields, np.int64)  # 0, a vehicle's: not drawn yet
        self._every = np.ones(number, np.bool_)
        self._counters = new_counters()
        self._crew: HelperThreads | None = None

    @property
    def outcome(self) -> NDArray[np.int64]:
        """(N,) NOT_STARTED, or codes of outcomes; a flight that goes on has FLYING."""
        return self._job.flights["outcome"]

    def make_room(self, field: Field) -> None:
        """Let fields have as many obstacles as this one.

        Raises:
            TypeError, ValueError: as `Bank.make_room`.
        """
        self._bank.make_room(field)
        self._job = self._job._replace(world=self._bank.world)
        self._bare = step_kernel.as_plain_tuple(self._job)
        self._crew = None  # which works on the job as it was

    def begin(
        self,
        chosen: Flags,
        fields: Sequence[Field | int | None],
        streams: Sequence[np.random.Generator],
        renewed: Flags,
    ) -> None:
        """Start flights; `seen` and `reports` are of all vehicles.

        Args:
            chosen: (N,) vehicles that start.
            fields: for each a field, the seed of one, or None: the next of its stream.
            streams: (N,) from which the seeds of later fields are drawn.
            renewed: (N,) streams that began anew, so that what they gave before is void.

        Raises:
            TypeError, ValueError: as `Bank.check`; then nothing has changed.
        """
        flights, which = self._job.flights, np.flatnonzero(chosen).tolist()
        laid = {}
        for i in which:
            if (field := fields[i]) is not None:
                laid[i] = field if isinstance(field, Field) else self.settings.field(field)
                self._bank.check(laid[i])
        flights["next"][renewed] = VOID
        drawn = chosen.copy()
        drawn[list(laid)] = False
        self._draw_ahead(drawn, streams)
        for i in which:
            if i in laid:
                self._bank.put(i, laid[i])
                self._given[i], flights["slot"][i] = laid[i], i
            else:
                flights["slot"][i] = self._job.queue[i, flights["next"][i]]
                flights["next"][i] += 1
        step_kernel.begin(self._bare, chosen)

    def step(self, actions: Action, streams: Sequence[np.random.Generator]) -> None:
        """Fly one action (4,) of each vehicle.

        Raises:
            ValueError: actions that are not finite or outside [-1, 1].
        """
        if (bad := step_kernel.first_bad(actions)) >= 0:
            where = f" (environment {bad})" if self.number > 1 else ""
            check_action(actions[bad], where)
        if self._job.mode != step_kernel.DISABLED and step_kernel.used_up(self._job.flights, BLOCK):
            # before the step, so that one that was interrupted leaves nothing undone
            self._draw_ahead(self._every, streams)
        self._job.actions[:] = actions
        if self.number >= MANY:
            if self._crew is None:
                self._crew = self._hire()
            self._crew.call()
        step_kernel.advance(self._bare, self._counters)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but threads, which a copy hires anew."""
        return self.__dict__ | {"_crew": None}

    def _hire(self) -> HelperThreads:
        # the threads must not keep the fleet alive
        job, counters = self._bare, self._counters
        threads = min(numba.get_num_threads(), self.number // step_kernel.CHUNK)
        return HelperThreads(
            lambda: step_kernel.help_out(job, counters, step_kernel.FROM_BACK, PATIENCE),
            threads - 1,
        )

    def _draw_ahead(self, chosen: Flags, streams: Sequence[np.random.Generator]) -> None:
        """Draw a block of seeds for each chosen vehicle that has used up its own."""
        flights = self._job.flights
        for i in np.flatnonzero(chosen & (flights["next"] >= BLOCK)).tolist():
            size = FIRST if flights["next"][i] == VOID else BLOCK
            seeds = streams[i].integers(self.settings.fields, size=size)
            slots = self._slot_of[seeds]
            if not slots.all():
                self._lay_out(seeds[slots == 0].tolist())
                slots = self._slot_of[seeds]
            self._job.queue[i, BLOCK - size :], flights["next"][i] = slots, BLOCK - size

    def _lay_out(self, seeds: list[int]) -> None:
        for seed in seeds:
            if self._slot_of[seed] == 0:
                slot = self.number + len(self._drawn)
                self._bank.put_discs(slot, self.settings.discs(seed))
                self._drawn.append(seed)
                self._slot_of[seed] = slot

    @property
    def seen(self) -> Single:
        """Observations (N n,), entry after entry; the next step writes over them."""
        return self._job.seen

    @property
    def reports(self) -> Records:
        """What the last step or reset reported (N,); the next writes over it."""
        return self._job.reports

    @property
    def last(self) -> tuple[Single, Records]:
        """In SAME_STEP, what flights saw and reported that ended in the last step."""
        return self._job.last_seen, self._job.last_reports

    def field(self, i: int) -> Field:
        """The field that a vehicle flies in."""
        slot = int(self._job.flights["slot"][i])
        given = self._given[slot] if slot < self.number else None
        return given or self.settings.field(self._drawn[slot - self.number])

    def state(self, i: int) -> State:
        """A vehicle's state, exactly."""
        flight = self._job.flights[i]
        return State(
            flight["position"].copy(), flight["derivative"].copy(), int(flight["segments"])
        )

    def control(self, i: int) -> Array:
        """Segments (n, 4, 2) that a vehicle has flown."""
        return self._job.paths[i, : self._job.flights[i]["segments"]].copy()

    def refused(self, i: int) -> Array | None:
        """The segment (4, 2) that ended a flight without being flown, if one did."""
        flight = self._job.flights[i]
        if flight["outcome"] == NOT_STARTED:
            return None
        if Outcome.from_code(int(flight["outcome"])) in FLOWN:
            return None
        control: Array = self._job.paths[i, flight["segments"]].copy()
        return control
