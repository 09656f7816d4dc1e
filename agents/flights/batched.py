"""Flying a learned policy through many fields at once, with the same results as one by one.

A network's output for one observation does not depend on the others in the batch
(`agents.models.model.Network`), so flights are the same, to the last bit, in batches of any size.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from gymnasium.vector import AutoresetMode

from agents.flights.flight import Flight
from agents.models import Model
from ferguson_gym.simulation.settings import OBSERVING, Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world import Field, Obstacles, Outcome

BATCH = 48
"""Flights at a time by default: few enough for the environment to step them without threads of
its own, which would compete with the network for the processor."""


_NOWHERE = Field(name="nowhere", obstacles=Obstacles.discs(np.empty((0, 2)), np.empty(0)))


def fly_batch(
    model: Model, fields: Iterable[Field], num: int = BATCH, name: str = "agent"
) -> list[Flight]:
    """Fly a model, by its deterministic actions, once through each field, in this order.

    `num` flights at a time are flown, which changes no flight; they call their policy `name`.

    Raises:
        ValueError: A field that is not planar, or `num` below 1.
        TypeError: Obstacles other than discs.
    """
    if num < 1:
        raise ValueError(f"need at least one flight at a time, got num={num}")
    fields = list(fields)
    if not fields:
        return []
    began = time.perf_counter()
    with model.network.session():
        flights = _fly(model, fields, min(num, len(fields)), name)
    share = (time.perf_counter() - began) / len(fields)
    return [replace(flight, seconds=share) for flight in flights]


def _fly(model: Model, fields: Sequence[Field], num: int, name: str) -> list[Flight]:
    envs = _environments(model.settings, fields, num)
    flights: dict[int, Flight] = {}
    waiting = iter(range(num, len(fields)))
    flown = np.arange(num)  # index of each environment's field; -1 when no field is left
    observations, _ = envs.reset(seed=0, options={"field": fields[:num]})
    while (busy := flown >= 0).any():
        actions = np.zeros((num, 4), np.float32)
        actions[busy] = model.network.act({key: rows[busy] for key, rows in observations.items()})
        observations, _, terminated, truncated, infos = envs.step(actions)
        ended = terminated | truncated
        for i in np.flatnonzero(ended & busy).tolist():
            flights[flown[i]] = Flight(
                policy=name,
                field=fields[flown[i]],
                outcome=Outcome.from_code(int(infos["outcome"][i])),
                control=np.asarray(envs.control(i)),
                refused=envs.refused(i),
                clearance=float(infos["clearance"][i]),
            )
            flown[i] = next(waiting, -1)
        if ended.any():
            # environments without a flight fly where nothing is; the result is not used
            next_fields = [fields[k] if k >= 0 else _NOWHERE for k in flown.tolist()]
            observations, _ = envs.reset(options={"reset_mask": ended, "field": next_fields})
    return [flights[k] for k in range(len(fields))]


def _environments(settings: Settings, fields: Sequence[Field], number: int) -> VectorObstacleField:
    """Environments with the observations of these settings and capacity for every field."""
    most = max(len(field.obstacles) for field in fields)
    return VectorObstacleField(
        number,
        autoreset_mode=AutoresetMode.DISABLED,
        fields=1,
        capacity=max(most, Settings().max_obstacles),
        **{name: getattr(settings, name) for name in OBSERVING},
    )
