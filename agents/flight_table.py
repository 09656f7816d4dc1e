"""Flights of an evaluation, read back from its directory as arrays."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.results import FLIGHT_COLUMNS, TIMING_COLUMNS
from ferguson_gym.arrays import Array

TIMES = TIMING_COLUMNS[3:]
"""Columns of timings.csv beside its keys [s]."""
_KEYS = ("policy", "field", "seed")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FlightTable:
    """All flights of an evaluation, in the order of flights.csv, n of them.

    Numbers that a flight does not have, such as the gap of a failure, are NaN.
    """

    policies: tuple[str, ...]
    """In the order in which they first occur, as the next two."""
    fields: tuple[str, ...]
    seeds: tuple[int, ...]
    policy: NDArray[np.int64]
    """(n,) index into `policies`; likewise the next two."""
    field: NDArray[np.int64]
    seed: NDArray[np.int64]
    outcome: tuple[str, ...]
    """Stable names of outcomes, n of them."""
    success: NDArray[np.bool_]
    """(n,)."""
    length: Array
    """(n,) flown [m]."""
    exact: Array
    """(n,) of the field's shortest path [m]; NaN without one."""
    gap: Array
    """(n,) length / exact - 1; NaN for failures and without a shortest path."""
    times: dict[str, Array]
    """Each (n,) [s], by the columns of timings.csv; NaN where they are not known."""

    def __len__(self) -> int:
        return len(self.success)

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many policies, fields and seeds."""
        return len(self.policies), len(self.fields), len(self.seeds)

    def grid(self, values: NDArray[np.generic], fill: float = math.nan) -> Array:
        """Values of all flights, (policies, fields, seeds); `fill` where none was flown."""
        grid = np.full(self.shape, fill)
        grid[self.policy, self.field, self.seed] = values
        return grid


def read(directory: Path) -> FlightTable:
    """Read flights.csv and, where there is one, timings.csv.

    Raises:
        ValueError: no flights.csv, columns missing, a cell that is no number, or a flight
            that is there twice; the message names the file and the line.
    """
    path = directory / "flights.csv"
    if not path.is_file():
        raise ValueError(f"no flights.csv in {directory}: not the results of an evaluation")
    keys: dict[tuple[str, str, str], int] = {}
    outcomes: list[str] = []
    numbers: list[tuple[float, ...]] = []
    for line, row in _rows(path, FLIGHT_COLUMNS):
        try:
            int(row["seed"])
            numbers.append(
                tuple(_number(row[key]) for key in ("success", "length", "exact_length", "gap"))
            )
        except ValueError as error:
            raise ValueError(f"{path}, line {line}: {error}") from None
        if keys.setdefault(_key(row), len(keys)) != len(outcomes):
            raise ValueError(f"{path}, line {line}: the flight {' '.join(_key(row))} twice")
        outcomes.append(row["outcome"])
    success, length, exact, gap = np.array(numbers).reshape(-1, 4).T
    policy, field, seed = ([key[k] for key in keys] for k in range(3))
    policies, fields, seeds = (tuple(dict.fromkeys(names)) for names in (policy, field, seed))
    return FlightTable(
        policies=policies,
        fields=fields,
        seeds=tuple(map(int, seeds)),
        policy=_index(policy, policies),
        field=_index(field, fields),
        seed=_index(seed, seeds),
        outcome=tuple(outcomes),
        success=success > 0.0,
        length=length,
        exact=exact,
        gap=gap,
        times=_times(directory / "timings.csv", keys),
    )


def _times(path: Path, keys: dict[tuple[str, str, str], int]) -> dict[str, Array]:
    times = {name: np.full(len(keys), math.nan) for name in TIMES}
    if path.is_file():
        for line, row in _rows(path, TIMING_COLUMNS):
            if (k := keys.get(_key(row))) is None:
                continue
            try:
                for name in TIMES:
                    times[name][k] = _number(row[name])
            except ValueError as error:
                raise ValueError(f"{path}, line {line}: {error}") from None
    return times


def _rows(path: Path, columns: tuple[str, ...]) -> Iterator[tuple[int, dict[str, str]]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        if missing := [name for name in columns if name not in (rows.fieldnames or ())]:
            raise ValueError(f"{path} has no column {', '.join(missing)}")
        for row in rows:
            if None in row or None in row.values():
                raise ValueError(f"{path}, line {rows.line_num}: not as many cells as columns")
            yield rows.line_num, row


def _key(row: dict[str, str]) -> tuple[str, str, str]:
    return row["policy"], row["field"], row["seed"]


def _number(cell: str) -> float:
    return float(cell) if cell else math.nan


def _index(values: list[str], names: tuple[str, ...]) -> NDArray[np.int64]:
    position = {name: k for k, name in enumerate(names)}
    return np.array([position[value] for value in values], np.int64)
