"""Flights of an evaluation, read back from its directory as arrays."""

from __future__ import annotations

import csv
import math
import sys
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.results import FLIGHT_COLUMNS, TIMING_COLUMNS
from ferguson_gym.runtime.arrays import LARGEST, Array, truncate_repr
from ferguson_gym.world.outcome import Outcome

TIMES = TIMING_COLUMNS[3:]
"""Columns of timings.csv beside its keys [s]."""
_KEYS = ("policy", "field", "seed")
_NUMBERS = ("success", "length", "exact_length", "gap")


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


class _Names(dict[str, int]):
    """Names by the order in which they came."""

    def __missing__(self, name: str) -> int:
        self[name] = len(self)
        return self[name]


def read(directory: Path) -> FlightTable:
    """Read flights.csv and, where there is one, timings.csv.

    Raises:
        ValueError: no flights.csv, columns missing, a cell that is no number, or a flight
            that is there twice; the message names the file and the line.
    """
    path = directory / "flights.csv"
    if not path.is_file():
        raise ValueError(f"no flights.csv in {directory}: not the results of an evaluation")
    names = tuple(_Names() for _ in _KEYS)
    outcomes: list[str] = []
    # arrays, for they hold a million flights where lists of objects hold some ten thousand
    lines, places, numbers = array("q"), array("q"), array("d")
    for line, row in _rows(path, FLIGHT_COLUMNS, (*_KEYS, "outcome", *_NUMBERS)):
        try:
            int(row[2])
            numbers.extend(_told(*row[3:]))
        except ValueError as error:
            raise ValueError(f"{path}, line {line}: {error}") from None
        places.extend(known[name] for known, name in zip(names, row, strict=False))
        outcomes.append(sys.intern(row[3]))
        lines.append(line)
    place = np.array(places, np.int64).reshape(-1, 3).T
    keys = _keys(place, names)
    order = np.argsort(keys, kind="stable")
    again = order[1:][np.diff(keys[order]) == 0]
    if len(again):
        k = int(again.min())
        told = " ".join(list(known)[i] for known, i in zip(names, place[:, k], strict=True))
        raise ValueError(f"{path}, line {lines[k]}: the flight {told} twice")
    success, length, exact, gap = np.array(numbers).reshape(-1, 4).T
    return FlightTable(
        policies=tuple(names[0]),
        fields=tuple(names[1]),
        seeds=tuple(map(int, names[2])),
        policy=place[0],
        field=place[1],
        seed=place[2],
        outcome=tuple(outcomes),
        success=success > 0.0,
        length=length,
        exact=exact,
        gap=gap,
        times=_times(directory / "timings.csv", names, keys, order),
    )


def _keys(place: NDArray[np.int64], names: tuple[_Names, ...]) -> NDArray[np.int64]:
    """A number for each flight, of its places (3, n) among the names."""
    keys: NDArray[np.int64] = (place[0] * len(names[1]) + place[1]) * len(names[2]) + place[2]
    return keys


def _times(
    path: Path, names: tuple[_Names, ...], keys: NDArray[np.int64], order: NDArray[np.int64]
) -> dict[str, Array]:
    """Times of the flights with these keys, which `order` sorts."""
    times = np.full((len(TIMES), len(keys)), math.nan)
    if path.is_file() and len(keys):
        places, seconds = array("q"), array("d")
        for line, row in _rows(path, TIMING_COLUMNS, TIMING_COLUMNS):
            place = [known.get(name, -1) for known, name in zip(names, row, strict=False)]
            if min(place) < 0:
                continue
            try:
                seconds.extend(map(_number, row[len(_KEYS) :]))
            except ValueError as error:
                raise ValueError(f"{path}, line {line}: {error}") from None
            places.extend(place)
        timed = _keys(np.array(places, np.int64).reshape(-1, 3).T, names)
        rank = np.searchsorted(keys, timed, sorter=order)
        flight = order[np.minimum(rank, len(keys) - 1)]
        flown = keys[flight] == timed
        times[:, flight[flown]] = np.array(seconds).reshape(-1, len(TIMES)).T[:, flown]
    return dict(zip(TIMES, times, strict=True))


def _rows(
    path: Path, columns: tuple[str, ...], wanted: tuple[str, ...]
) -> Iterator[tuple[int, Sequence[str]]]:
    """Lines and their wanted cells; all of the columns must be there."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        try:
            head = next(rows, [])
            if missing := [name for name in columns if name not in head]:
                raise ValueError(f"{path} has no column {', '.join(missing)}")
            cells = itemgetter(*map(head.index, wanted))
            for row in rows:
                if not row:  # an empty line
                    continue
                if len(row) != len(head):
                    raise ValueError(f"{path}, line {rows.line_num}: not as many cells as columns")
                yield rows.line_num, cells(row)
        except (UnicodeDecodeError, csv.Error) as error:
            raise ValueError(f"{path}, line {rows.line_num + 1}: {error}") from None


def _told(outcome: str, *cells: str) -> tuple[float, ...]:
    """Success, length, exact length and gap, which make sense together."""
    numbers = tuple(map(_number, cells))
    success, length, exact, _ = numbers
    if outcome not in _OUTCOMES:
        raise ValueError(f"unknown outcome {truncate_repr(outcome)}")
    if success not in (0.0, 1.0) or (success == 1.0) != _OUTCOMES[outcome]:
        raise ValueError(f"success {cells[0]!r} of a flight that ends {outcome}")
    if not length >= 0.0 or exact <= 0.0:
        raise ValueError(f"lengths {cells[1]!r} and {cells[2]!r}")
    return numbers


_OUTCOMES = {outcome.label: outcome.success for outcome in Outcome}


def _number(cell: str) -> float:
    """Of a cell; NaN for an empty one."""
    if not cell:
        return math.nan
    number = float(cell)
    if not abs(number) <= LARGEST:
        raise ValueError(f"{cell} is no number that is measured")
    return number
