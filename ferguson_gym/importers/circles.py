"""Tables of circles, one a line: x, y and radius, with or without a header."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np

from ferguson_gym.importers.placement import Placement
from ferguson_gym.runtime.arrays import check_size, truncate_repr
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

_COLUMNS = ("x", "y", "radius")


def read_circles(
    path: str | os.PathLike[str], placement: Placement | None = None, scale: float = 1.0
) -> Field:
    """The field of a CSV file of circles; the file's stem is its name.

    Without a header the first three columns are x, y and radius. With a header, they are the
    columns of these names, in any order, and other columns are ignored. Empty lines are skipped.

    Args:
        path: the file.
        placement: start, goal, bounds and limits.
        scale: metres of a unit of the file.

    Raises:
        ValueError: a line without three numbers, or values that `Field` refuses; the message names
            file and line.
        OSError: the file cannot be read.
    """
    path = Path(path)
    with path.open(newline="", encoding="utf-8-sig") as file:
        try:
            every = enumerate(csv.reader(file, skipinitialspace=True), 1)
            rows = [(number, row) for number, row in every if "".join(row).strip()]
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(f"{path}: not a CSV file: {error}") from None
    columns = [0, 1, 2]
    if rows and not _is_number(rows[0][1][0]):
        header = [name.strip().lower() for name in rows.pop(0)[1]]
        if missing := [name for name in _COLUMNS if name not in header]:
            raise ValueError(
                f"{path}, line 1: the header has no {' and no '.join(missing)}; circles need "
                f"columns {', '.join(_COLUMNS)}, separated by commas"
            )
        columns = [header.index(name) for name in _COLUMNS]
    circles: list[list[float]] = []
    for number, row in rows:
        try:
            circles.append([scale * float(row[column]) for column in columns])
        except (ValueError, IndexError):
            raise ValueError(
                f"{path}, line {number}: need the numbers x, y and radius, separated by commas, "
                f"got {truncate_repr(','.join(row))}"
            ) from None
        if not circles[-1][2] > 0.0:
            raise ValueError(
                f"{path}, line {number}: a radius must be above 0, got {row[columns[2]]}"
            )
        try:
            check_size("x, y and radius", np.array(circles[-1]))
        except ValueError as error:
            raise ValueError(f"{path}, line {number}: {error}") from None
    if not circles:
        raise ValueError(f"{path}: no circles; each line needs x, y and radius")
    try:
        obstacles = Obstacles.discs([row[:2] for row in circles], [row[2] for row in circles])
        return (placement or Placement()).field(path.stem, obstacles)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
