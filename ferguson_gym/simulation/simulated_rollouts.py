"""Simulated rollouts: flights from any states, stepped as the environment does.

The compiled step is the environment's own (`ferguson_gym.simulation.step_kernel`), so that what a
rollout predicts is what the environment does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.field_store import FieldArrays, FieldStore
from ferguson_gym.simulation.observations import Observation, entries_of
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import (
    DISABLED,
    StepBuffers,
    as_plain_tuple,
    make_buffers,
)
from ferguson_gym.simulation.ways import Ways
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field, planar_obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State

_FLYING, _ARRIVED = Outcome.FLYING.code, Outcome.GOAL_REACHED.code
_NOT_REFUSED = (_FLYING, _ARRIVED, Outcome.OUT_OF_SEGMENTS.code)


class SimulatedRollouts:
    """Rollouts numbered from 0 on, of which only the active ones are stepped.

    Args:
        fields: in which they fly.
        which: (n,) number of the field of each rollout.
        vehicles: (n,) states in which they start.
        settings: of observations and limits.

    Raises:
        ValueError: a field that is not planar, or a state that has no segments left.
    """

    def __init__(
        self,
        fields: Sequence[Field],
        which: ArrayLike,
        vehicles: Sequence[State],
        settings: Settings,
    ) -> None:
        store = FieldStore(len(fields), max(len(planar_obstacles(field)) for field in fields))
        for field in fields:
            store.ensure_capacity(field)
        for slot, field in enumerate(fields):
            store.put(slot, field)
        self._fields = fields
        self._settings, self._sizes = settings, settings.layout.entries()
        self._segments = max(field.limits.segments for field in fields)
        self._buffers = self._made(settings, len(vehicles), store.arrays)
        flights = self._buffers.flights
        flights["slot"] = which
        own = store.arrays.records[flights["slot"]]
        flights["gate"] = own["gate"] if settings.gate is None else settings.gate
        flights["most"] = settings.segments or own["segments"]
        flights["detour"], flights["failure"] = settings.detour, settings.failure
        flights["position"] = [vehicle.position for vehicle in vehicles]
        flights["derivative"] = [vehicle.derivative for vehicle in vehicles]
        flights["segments"] = [vehicle.segments for vehicle in vehicles]
        flights["outcome"], flights["clearance"] = _FLYING, np.inf
        if (spent := flights["segments"] >= flights["most"]).any():
            number = int(flights["segments"][spent][0])
            raise ValueError(f"a rollout cannot begin after {number} segments: none are left")
        self._counters = new_counters()
        self.ways = Ways(settings, len(vehicles), self._field_in)
        """The ways of the fields."""
        self.active: NDArray[np.int64] = np.arange(len(vehicles))
        """Numbers (n,) of the active rollouts."""
        self._observe(self._buffers)

    def _field_in(self, slot: int) -> Field:
        return self._fields[slot]

    def _made(self, settings: Settings, number: int, fields: FieldArrays) -> StepBuffers:
        return make_buffers(settings, number, fields, DISABLED, longest=self._segments)

    def _observe(self, buffers: StepBuffers) -> None:
        step_kernel.reset(as_plain_tuple(buffers), np.zeros(len(buffers.flights), np.bool_))
        self._show(buffers)

    def _show(self, buffers: StepBuffers) -> None:
        if buffers.layout.way:
            everyone = np.arange(len(buffers.flights))
            self.ways.write(buffers.observations, buffers, buffers.flights, everyone)

    @property
    def buffers(self) -> StepBuffers:
        """What a step of the active rollouts reads and writes."""
        return self._buffers

    def observed(self, settings: Settings) -> Observation:
        """Observations (n, size) of the active rollouts in other settings, of the same margin."""
        buffers = self._made(settings, len(self.active), self._buffers.fields)
        buffers.flights[:] = self._buffers.flights
        self._observe(buffers)
        return entries_of(buffers.observations, settings.layout.entries(), len(self.active))

    @property
    def observations(self) -> Observation:
        """Observations (n, size) of the active rollouts, by entry."""
        return entries_of(self._buffers.observations, self._sizes, len(self.active))

    @property
    def positions(self) -> Array:
        """Positions (n, 2) [m] after the last step; a refused segment leaves them unchanged."""
        return self._buffers.flights["position"]

    @property
    def lengths(self) -> Array:
        """Path lengths (n,) [m], from the first states on."""
        return self._buffers.flights["path_length"]

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Which of the active rollouts are on the goal (n,)."""
        arrived: NDArray[np.bool_] = self._buffers.flights["outcome"] == _ARRIVED
        return arrived

    @property
    def flying(self) -> NDArray[np.bool_]:
        """Which of the active rollouts have not ended (n,)."""
        flying: NDArray[np.bool_] = self._buffers.flights["outcome"] == _FLYING
        return flying

    def step(self, actions: Action) -> None:
        """Fly one action each: (n, 4) in [-1, 1]."""
        self._buffers.actions[:] = actions
        buffers = as_plain_tuple(self._buffers)
        step_kernel.advance(buffers, self._counters, step_kernel.FROM_FRONT, 0)
        self._show(self._buffers)

    def step_or(self, actions: Action, others: Action) -> NDArray[np.bool_]:
        """Fly one action each, and another one where the first is refused.

        Args:
            actions: (n, 4) in [-1, 1].
            others: (n, 4) in [-1, 1].

        Returns:
            Which actions were refused (n,).
        """
        flights = self._buffers.flights
        before = flights.copy()
        self.step(actions)
        refused: NDArray[np.bool_] = ~np.isin(flights["outcome"], _NOT_REFUSED)
        if refused.any():
            flights[:] = before
            self.step(np.where(refused[:, None], others, actions))
        return refused

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Let only the chosen (n,) of the active rollouts stay active."""
        if chosen.all():
            return
        old, observations = self._buffers, self.observations
        self.active = self.active[chosen]
        new = self._made(self._settings, len(self.active), old.fields)
        new.flights[:] = old.flights[chosen]
        for key, values in entries_of(new.observations, self._sizes, len(self.active)).items():
            values[:] = observations[key][chosen]
        self._buffers = new
