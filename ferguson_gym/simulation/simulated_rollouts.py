"""Imagined flights: vehicles that set out together from any state, stepped as the environment does.

What is imagined is judged by the compiled code that judges flights
(`ferguson_gym.simulation.step_kernel`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.helper_threads import new_counters
from ferguson_gym.simulation import step_kernel
from ferguson_gym.simulation.field_store import FieldStore
from ferguson_gym.simulation.observations import Observation, entries_of
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field, planar_discs
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State

_FLYING, _ARRIVED = Outcome.FLYING.code, Outcome.GOAL_REACHED.code


class SimulatedRollouts:
    """Flights of one field, numbered from 0 on; those that are over, or given up, are not stepped.

    Args:
        field: that they fly.
        vehicle: where they begin.
        number: of flights.
        settings: of what is seen, and of the limits.

    Raises:
        TypeError: obstacles other than discs.
        ValueError: a field that is not planar.
    """

    def __init__(self, field: Field, vehicle: State, number: int, settings: Settings) -> None:
        bank = FieldStore(1, len(planar_discs(field)))
        bank.put(0, field)
        flights = np.zeros(number, step_kernel.FLIGHT)
        flights["position"], flights["derivative"] = vehicle.position, vehicle.derivative
        flights["segments"], flights["outcome"] = vehicle.segments, _FLYING
        flights["clearance"] = np.inf
        layout = settings.layout
        self._sizes = layout.entries()
        values = number * sum(self._sizes.values())
        self._job = step_kernel.StepBuffers(
            flights=flights,
            paths=np.empty((number, settings.limits.segments + 1, 4, 2)),
            queue=np.zeros((number, 1), np.int64),
            world=bank.world,
            actions=np.empty((number, 4), np.float32),
            limits=settings.limits.numbers(),
            prices=settings.prices,
            layout=layout,
            mode=step_kernel.DISABLED,
            seen=np.empty(values, np.float32),
            reports=np.empty(number, step_kernel.REPORT),
            last_seen=np.empty(0, np.float32),
            last_reports=np.empty(0, step_kernel.REPORT),
        )
        self._counters = new_counters()
        self.which: NDArray[np.int64] = np.arange(number)
        """Numbers (n,) of the flights that go on."""
        step_kernel.begin(step_kernel.as_plain_tuple(self._job), np.zeros(number, np.bool_))

    @property
    def seen(self) -> Observation:
        """What those that go on see (n, size), by entry."""
        return entries_of(self._job.seen, self._sizes, len(self.which))

    @property
    def ends(self) -> Array:
        """Where the last step led them, or would have (n, 2)."""
        return self._job.flights["position"]

    @property
    def lengths(self) -> Array:
        """What they have flown (n,) [m]."""
        return self._job.flights["path_length"]

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Which of them are on the goal (n,)."""
        arrived: NDArray[np.bool_] = self._job.flights["outcome"] == _ARRIVED
        return arrived

    @property
    def flying(self) -> NDArray[np.bool_]:
        """Which of them are not over (n,)."""
        flying: NDArray[np.bool_] = self._job.flights["outcome"] == _FLYING
        return flying

    def step(self, actions: Action) -> None:
        """Fly one action (4,) in [-1, 1] of each that goes on; what they see is of after it."""
        self._job.actions[:] = actions
        step_kernel.advance(step_kernel.as_plain_tuple(self._job), self._counters)

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Let those go on that are chosen (n,)."""
        if chosen.all():
            return
        count, job, seen = int(chosen.sum()), self._job, self.seen
        self.which = self.which[chosen]
        self._job = job._replace(
            flights=job.flights[chosen],
            paths=job.paths[:count],
            queue=job.queue[:count],
            actions=job.actions[:count],
            seen=np.concatenate([seen[key][chosen].ravel() for key in self._sizes]),
            reports=job.reports[:count],
        )
