"""Reading a finished evaluation back from its directory: flights.csv and timings.csv."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.results import FLIGHT_COLUMNS, KEYS, TIMING_COLUMNS
from agents.flights.flight_table import TIMES, FlightTable
from ferguson_gym.runtime.arrays import LARGEST, Array, truncate_repr
from ferguson_gym.world import Outcome

_NUMBERS = ("success", "length", "exact_length", "gap")
_OUTCOMES = {outcome.label: outcome for outcome in Outcome}


class _Names(dict[str, int]):
    """Indices of names in the order of their first occurrence."""

    def __missing__(self, name: str) -> int:
        self[name] = len(self)
        return self[name]


def read(directory: Path) -> FlightTable:
    """Read flights.csv and, if it exists, timings.csv.

    Returns:
        The flights with the columns outcome, length, exact_length, gap and times.

    Raises:
        ValueError: There is no flights.csv, columns are missing, a cell is not a number, or a
            flight occurs twice; the message names the file and the line.
    """
    path = directory / "flights.csv"
    if not path.is_file():
        raise ValueError(f"no flights.csv in {directory}: not the results of an evaluation")
    names = tuple(_Names() for _ in KEYS)
    # arrays hold a million flights in the memory where lists hold some ten thousand
    lines, places, numbers = array("q"), array("q"), array("d")
    for line, row in _rows(path, FLIGHT_COLUMNS, (*KEYS, "outcome", *_NUMBERS)):
        try:
            int(row[2])
            numbers.extend(_parse(*row[3:]))
        except ValueError as error:
            raise ValueError(f"{path}, line {line}: {error}") from None
        places.extend(known[name] for known, name in zip(names, row, strict=False))
        lines.append(line)
    place = np.array(places, np.int64).reshape(-1, 3).T
    keys = _keys(place, names)
    order = np.argsort(keys, kind="stable")
    again = order[1:][np.diff(keys[order]) == 0]
    if len(again):
        k = int(again.min())
        flight = " ".join(list(known)[i] for known, i in zip(names, place[:, k], strict=True))
        raise ValueError(f"{path}, line {lines[k]}: the flight {flight} occurs twice")
    code, length, exact, gap = np.array(numbers).reshape(-1, 4).T
    times = _times(directory / "timings.csv", names, keys, order)
    return FlightTable(
        policies=tuple(names[0]),
        fields=tuple(names[1]),
        seeds=tuple(map(int, names[2])),
        policy=place[0],
        field=place[1],
        seed=place[2],
        columns={
            "outcome": code.astype(np.int8),
            "length": length,
            "exact_length": exact,
            "gap": gap,
            **dict(zip(TIMES, times, strict=True)),
        },
    )


def _keys(place: NDArray[np.int64], names: tuple[_Names, ...]) -> NDArray[np.int64]:
    """A number for each flight, from its indices (3, n) among the names."""
    return np.asarray((place[0] * len(names[1]) + place[1]) * len(names[2]) + place[2])


def _times(
    path: Path, names: tuple[_Names, ...], keys: NDArray[np.int64], order: NDArray[np.int64]
) -> Array:
    """Times (3, n) of the flights with these keys, which `order` sorts; NaN where not known."""
    times = np.full((len(TIMES), len(keys)), math.nan)
    if path.is_file() and len(keys):
        places, seconds = array("q"), array("d")
        for line, row in _rows(path, TIMING_COLUMNS, TIMING_COLUMNS):
            place = [known.get(name, -1) for known, name in zip(names, row, strict=False)]
            if min(place) < 0:
                continue
            try:
                seconds.extend(map(_number, row[len(KEYS) :]))
            except ValueError as error:
                raise ValueError(f"{path}, line {line}: {error}") from None
            places.extend(place)
        timed = _keys(np.array(places, np.int64).reshape(-1, 3).T, names)
        rank = np.searchsorted(keys, timed, sorter=order)
        flight = order[np.minimum(rank, len(keys) - 1)]
        flown = keys[flight] == timed
        times[:, flight[flown]] = np.array(seconds).reshape(-1, len(TIMES)).T[:, flown]
    return times


def _rows(
    path: Path, columns: tuple[str, ...], wanted: tuple[str, ...]
) -> Iterator[tuple[int, Sequence[str]]]:
    """Line numbers and the wanted cells; all of the columns must be there."""
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


def _parse(label: str, *cells: str) -> tuple[float, ...]:
    """Code of the outcome, length, exact length and gap, checked against each other."""
    success, length, exact, gap = map(_number, cells)
    if label not in _OUTCOMES:
        raise ValueError(f"unknown outcome {truncate_repr(label)}")
    outcome = _OUTCOMES[label]
    if success not in (0.0, 1.0) or (success == 1.0) != outcome.success:
        raise ValueError(f"success {cells[0]!r} of a flight with outcome {label}")
    if not length >= 0.0 or exact <= 0.0:
        raise ValueError(f"lengths {cells[1]!r} and {cells[2]!r}")
    return outcome.code, length, exact, gap


def _number(cell: str) -> float:
    """The number in a cell; NaN for an empty one."""
    if not cell:
        return math.nan
    number = float(cell)
    if not abs(number) <= LARGEST:
        raise ValueError(f"{cell} is not a measured number")
    return number
