"""Column-oriented table of flights, used on disk and by the statistics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.flights.flight import Flight
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Outcome
from ferguson_gym.world.paper_fields import is_from_paper
from planners.interface import Decision, WindowReport

Columns = Mapping[str, NDArray[Any]]
"""Arrays by name, with a row for each flight; `PATHS` have a row for each of their segments."""
TIMES = ("decision_seconds_median", "decision_seconds_max", "seconds")
"""Columns that a clock decides [s], rounded to microseconds."""
PATHS = ("refused", "window_counts", "window_segments", "windows", "control")
"""Columns of curves, which are left on disk where there are many flights."""
SHIELD = tuple(ShieldDecision)
"""Columns of `shield_steps`."""
_OUTCOMES = {outcome.code: outcome for outcome in Outcome}
_NO_SEGMENTS = np.empty((0, 4, 2))
_LENGTHS = {"control": "segments", "window_segments": "window_counts", "windows": "window_segments"}
"""Columns that are not as long as there are flights, and what counts their rows."""
_MAY_BE_NAN = ("exact_length", "gap", "decision_seconds_median", "decision_seconds_max", "refused")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FlightTable:
    """Flights of an evaluation, n of them, in the order of flights.csv."""

    policies: tuple[str, ...]
    """Names in the order in which they first occur; likewise the next two."""
    fields: tuple[str, ...]
    seeds: tuple[int, ...]
    policy: NDArray[np.int64]
    """(n,) index into `policies`; likewise the next two."""
    field: NDArray[np.int64]
    seed: NDArray[np.int64]
    columns: Columns
    """By name, as `columns_of` makes them; a table read from files has those that files have.
    Missing numbers, such as the gap of a failed flight, are NaN."""

    def __len__(self) -> int:
        return len(self.policy)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of policies, fields and seeds."""
        return len(self.policies), len(self.fields), len(self.seeds)

    @property
    def success(self) -> NDArray[np.bool_]:
        """(n,) whether each flight was feasible and ended on the goal."""
        return np.asarray(self["outcome"] == Outcome.GOAL_REACHED.code)

    @property
    def outcomes(self) -> list[Outcome]:
        """The outcome of each flight."""
        return [_OUTCOMES[code] for code in self["outcome"].tolist()]

    def grid(self, values: NDArray[np.generic], fill: float = math.nan) -> Array:
        """Values of all flights, (policies, fields, seeds); `fill` where none was flown."""
        grid = np.full(self.shape, fill)
        grid[self.policy, self.field, self.seed] = values
        return grid


def table_of(flights: Sequence[Flight]) -> FlightTable:
    """A table of flights, without windows."""
    names = [[f.policy for f in flights], [f.field.name for f in flights]]
    policies, fields = (tuple(dict.fromkeys(one)) for one in names)
    seeds = tuple(dict.fromkeys(flight.seed for flight in flights))
    return FlightTable(
        policies=policies,
        fields=fields,
        seeds=seeds,
        policy=np.array([policies.index(name) for name in names[0]], np.int64),
        field=np.array([fields.index(name) for name in names[1]], np.int64),
        seed=np.array([seeds.index(flight.seed) for flight in flights], np.int64),
        columns=columns_of(flights, [False] * len(flights)),
    )


def columns_of(flights: Sequence[Flight], drawn: Sequence[bool]) -> Columns:
    """Flights as columns; `drawn` says of which a picture needs the planner's windows."""
    windows = [one.windows if shown else [] for one, shown in zip(flights, drawn, strict=True)]
    chains = [chain for each in windows for chain in each]
    numbers = {
        "length": [flight.length for flight in flights],
        "exact_length": [_or_nan(flight.exact_length) for flight in flights],
        "gap": [_or_nan(flight.gap) for flight in flights],
        "clearance": [flight.clearance for flight in flights],
        "min_turn_radius": [flight.min_turn_radius for flight in flights],
        "decision_seconds_median": [_rounded(np.median, f.decision_seconds) for f in flights],
        "decision_seconds_max": [_rounded(np.max, f.decision_seconds) for f in flights],
        "seconds": [round(flight.seconds, 6) for flight in flights],
    }
    counts = {
        "segments": [len(flight.control) for flight in flights],
        "evaluations": [flight.evaluations for flight in flights],
        "window_counts": [len(each) for each in windows],
        "window_segments": [len(chain) for chain in chains],
    }
    steps = [[list(f.shield_decisions).count(one) for one in SHIELD] for f in flights]
    refused = [np.full((4, 2), math.nan) if f.refused is None else f.refused for f in flights]
    return {
        "outcome": np.array([flight.outcome.code for flight in flights], np.int8),
        "from_paper": np.array([is_from_paper(flight.field) for flight in flights], np.bool_),
        **{name: np.array(values, np.float64) for name, values in numbers.items()},
        **{name: np.array(values, np.int64) for name, values in counts.items()},
        "shield_steps": np.array(steps, np.int32).reshape(-1, len(SHIELD)),
        "refused": np.array(refused).reshape(-1, 4, 2),
        "windows": np.concatenate([_NO_SEGMENTS, *chains]),
        "control": np.concatenate([_NO_SEGMENTS, *(flight.control for flight in flights)]),
    }


def join(parts: Sequence[Columns]) -> Columns:
    """The columns of all flights of several parts, in order."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def check(columns: Columns, number: int) -> Columns:
    """Return columns from a file after checking them.

    Raises:
        ValueError: Columns are missing, of another kind or shape, or of another length than
            `number` flights have.
    """
    for name, like in columns_of((), ()).items():
        if name not in columns:
            raise ValueError(f"no {name}")
        found = columns[name]
        if found.dtype.kind != like.dtype.kind or found.shape[1:] != like.shape[1:]:
            raise ValueError(f"{name} is {found.shape} of {found.dtype}")
        counts = columns[_LENGTHS[name]] if name in _LENGTHS else None
        if counts is None and len(found) != number:
            raise ValueError(f"not {number} flights in {name}")
        if counts is not None and ((counts < 0).any() or len(found) != counts.sum()):
            raise ValueError(f"{name} has {len(found)} rows, unlike {_LENGTHS[name]}")
        if found.dtype.kind == "f" and name not in _MAY_BE_NAN and np.isnan(found).any():
            raise ValueError(f"NaN in {name}")
    if not np.isin(columns["outcome"], list(_OUTCOMES)).all():
        raise ValueError("unknown codes of outcome")
    return columns


def drawable(columns: Columns, index: int, policy: str, field: Field, seed: int) -> Flight:
    """A flight of some columns again, with what pictures show of it."""
    first, last = _span(columns["segments"], index)
    begin, end = _span(columns["window_counts"], index)
    spans = [_span(columns["window_segments"], k) for k in range(begin, end)]
    refused = columns["refused"][index]
    return Flight(
        policy=policy,
        field=field,
        seed=seed,
        outcome=_OUTCOMES[int(columns["outcome"][index])],
        control=columns["control"][first:last],
        refused=None if np.isnan(refused).any() else refused,
        clearance=float(columns["clearance"][index]),
        decisions=[
            Decision(columns["windows"][a:b], WindowReport(step=k, starts=1, seconds=0.0))
            for k, (a, b) in enumerate(spans)
        ],
    )


def _span(counts: NDArray[np.int64], index: int) -> tuple[int, int]:
    first = int(counts[:index].sum())
    return first, first + int(counts[index])


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _rounded(measure: Any, seconds: Sequence[float]) -> float:
    return round(float(measure(seconds)), 6) if len(seconds) else math.nan
