"""Simulated rollouts: flights of one field from a common state, stepped as the environment does.

The compiled step is the environment's own (`ferguson_gym.simulation.step_kernel`), so that what a
rollout predicts is what the environment does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.field_store import FieldArrays, FieldStore
from ferguson_gym.simulation.observations import Observation, entries_of
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.step_buffers import DISABLED, StepBuffers, as_plain_tuple, make_buffers
from ferguson_gym.simulation.ways import observe_way
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State

_FLYING, _ARRIVED = Outcome.FLYING.code, Outcome.GOAL_REACHED.code


class SimulatedRollouts:
    """Rollouts numbered from 0 on, of which only the active ones are stepped.

    Args:
        field: in which they fly.
        vehicle: the state in which they start.
        number: how many.
        settings: of observations and limits.

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar.
    """

    def __init__(self, field: Field, vehicle: State, number: int, settings: Settings) -> None:
        store = FieldStore(1, len(planar_discs(field)))
        store.put(0, field)
        self._settings, self._sizes = settings, settings.layout.entries()
        self._field, self._segments = field, field.limits.segments
        self._buffers = self._made(number, store.arrays)
        flights = self._buffers.flights
        flights["gate"] = field.limits.gate if settings.gate is None else settings.gate
        flights["most"] = settings.segments or field.limits.segments
        flights["detour"], flights["failure"] = settings.detour, settings.failure
        flights["position"], flights["derivative"] = vehicle.position, vehicle.derivative
        flights["segments"], flights["outcome"] = vehicle.segments, _FLYING
        flights["clearance"] = np.inf
        self._counters = new_counters()
        self.active: NDArray[np.int64] = np.arange(number)
        """Numbers (n,) of the active rollouts."""
        step_kernel.reset(as_plain_tuple(self._buffers), np.zeros(number, np.bool_))
        self._show_ways()

    def _made(self, number: int, fields: FieldArrays) -> StepBuffers:
        return make_buffers(self._settings, number, fields, DISABLED, longest=self._segments)

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
        """Path lengths (n,) [m], from the common state on."""
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
        self._show_ways()

    def _show_ways(self) -> None:
        if (layout := self._buffers.layout).way:
            flights = self._buffers.flights
            positions = np.ascontiguousarray(flights["position"])
            derivatives = np.ascontiguousarray(flights["derivative"])
            rows = observe_way(self._field, positions, derivatives, self._settings, layout)
            self.observations["way"][:] = rows

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Let only the chosen (n,) of the active rollouts stay active."""
        if chosen.all():
            return
        old, observations = self._buffers, self.observations
        self.active = self.active[chosen]
        new = self._made(len(self.active), old.fields)
        new.flights[:] = old.flights[chosen]
        for key, values in entries_of(new.observations, self._sizes, len(self.active)).items():
            values[:] = observations[key][chosen]
        self._buffers = new
