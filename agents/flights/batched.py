"""Learned policies through many fields at once, each flight as if it were alone.

A network's answer to a row does not depend on the rows beside it (`agents.models.model.Network`),
so flights are the same, to the last bit, however many are in the air.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.vector import AutoresetMode

from agents.flights.metrics import path_share, success_interval
from agents.models.model import Model
from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import exact_length, gap
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome

TOGETHER = 48
"""Flights in the air, if nothing else is said: so few that the environment flies them without
threads of its own, which would wait for work while the network has the processor."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BatchFlight:
    """One flight of many."""

    field: Field
    outcome: Outcome
    control: Array
    """Segments (n, 4, 2) flown, as far as it got."""
    clearance: float
    """Least clearance along what was flown [m]."""
    refused: Array | None = None
    """The segment (4, 2) that ended the flight without being flown, if one did."""

    @property
    def success(self) -> bool:
        """Whether the flight was feasible and ended on the goal."""
        return self.outcome.success

    @property
    def segments(self) -> int:
        """Segments flown."""
        return len(self.control)

    @property
    def length(self) -> float:
        """Length flown [m]."""
        return Path(self.control).length if len(self.control) else 0.0

    @property
    def exact_length(self) -> float | None:
        """Length of the field's shortest path [m]; None if there is none."""
        return exact_length(self.field)

    @property
    def gap(self) -> float | None:
        """Length / exact length - 1; None unless the flight succeeded."""
        exact = self.exact_length
        return None if exact is None or not self.success else gap(self.length, exact)


def fly_batch(model: Model, fields: Iterable[Field], num: int = TOGETHER) -> list[BatchFlight]:
    """Fly a model through fields, in their order; the same flights whatever `num` is.

    Args:
        model: what flies, by the actions it thinks best.
        fields: as many as there are.
        num: flights that are in the air together.

    Raises:
        ValueError: a field that is not planar, or `num` below 1.
        TypeError: obstacles other than discs.
    """
    if num < 1:
        raise ValueError(f"need at least one flight at a time, got num={num}")
    fields = list(fields)
    if not fields:
        return []
    with model.network.session():
        return _fly(model, fields, min(num, len(fields)))


def _fly(model: Model, fields: Sequence[Field], num: int) -> list[BatchFlight]:
    envs = _environments(model.settings, fields, num)
    flights: list[BatchFlight | None] = [None] * len(fields)
    waiting = iter(range(num, len(fields)))
    flown = np.arange(num)  # by each environment; -1: nothing any more
    seen, _ = envs.reset(seed=0, options={"field": fields[:num]})
    while (busy := flown >= 0).any():
        actions = np.zeros((num, 4), np.float32)
        actions[busy] = model.network.act({key: value[busy] for key, value in seen.items()})
        seen, _, terminated, truncated, infos = envs.step(actions)
        ended = terminated | truncated
        for i in np.flatnonzero(ended & busy).tolist():
            flights[flown[i]] = BatchFlight(
                field=fields[flown[i]],
                outcome=Outcome.from_code(int(infos["outcome"][i])),
                control=envs.control(i),
                clearance=float(infos["clearance"][i]),
                refused=envs.refused(i),
            )
            flown[i] = next(waiting, -1)
        if ended.any():
            # those without a flight go round in a field that they know
            next_fields = [fields[max(k, 0)] for k in flown.tolist()]
            seen, _ = envs.reset(options={"reset_mask": ended, "field": next_fields})
    return [flight for flight in flights if flight is not None]


def _environments(settings: Settings, fields: Sequence[Field], number: int) -> VectorObstacleField:
    """Environments that show what these settings show, with room for every field."""
    most = max(len(field.obstacles) for field in fields)
    return VectorObstacleField(
        number,
        autoreset_mode=AutoresetMode.DISABLED,
        fields=1,
        capacity=max(most, Settings().most),
        observation=settings.observation,
        nearest=settings.nearest,
        focus=settings.focus,
        rays=settings.rays,
        view=settings.view,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """What many flights came to."""

    flights: int
    success: float
    """Share that arrived."""
    success_low: float
    """Lower end of Wilson's 95 % interval of it."""
    success_high: float
    spl: float
    """Mean of success x exact / max(length, exact)."""
    gap: float | None
    """Median over arrivals; None without any."""


def score(flights: Sequence[BatchFlight]) -> Score:
    """Score flights.

    Raises:
        ValueError: there are none.
    """
    gaps = [one.gap for one in flights if one.gap is not None]
    arrived = sum(flight.success for flight in flights)
    low, high = success_interval(arrived, len(flights))
    return Score(
        flights=len(flights),
        success=arrived / len(flights),
        success_low=low,
        success_high=high,
        spl=float(np.mean([path_share(f.success, f.length, f.exact_length) for f in flights])),
        gap=float(np.median(gaps)) if gaps else None,
    )
