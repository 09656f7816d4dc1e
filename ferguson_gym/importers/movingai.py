"""Grids and scenarios of the MovingAI pathfinding benchmarks."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.importers.grid_rectangles import corner_squares, overlapping
from ferguson_gym.runtime.arrays import truncate_repr
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.obstacles import Obstacles

CELL = 3.0
"""Default side of a cell [m]: the length of the shortest segment."""
CENTERS, CORNERS = "centers", "corners"
_PASSABLE, _BLOCKED = ".GS", "@OTW"
_MOST_CELLS = 2**26
"""Upper limit of a map's cells."""


class Pair(NamedTuple):
    """A start and a goal of a scenario, as column and row of their cells, from the upper left."""

    number: int
    """From 0, in the order of the scenario."""
    start: tuple[int, int]
    goal: tuple[int, int]


def read_map(
    path: str | os.PathLike[str],
    scenario: str | os.PathLike[str] | None = None,
    pairs: range | None = None,
    *,
    cell: float = CELL,
    points: str = CENTERS,
    close_corners: bool = False,
    limits: Mapping[str, float] | None = None,
) -> Iterator[Field]:
    """The fields of a map, one for each pair of start and goal of its scenario.

    A field is named after the map's stem and the number of the pair. Cells `.`, `G` and `S` are
    free, `@`, `O`, `T` and `W` are blocked. Column x and row y from the upper left become x and
    height - y in a plane whose y axis points up; bounds are the map's border.

    Args:
        path: the `.map` file.
        scenario: the `.scen` file; None: the map's path with `.scen` behind it.
        pairs: numbers of the pairs, from 0; None: all.
        cell: side of a cell [m].
        points: whether start and goal are the `centers` of their cells, as paths from cell to cell
            have it, or their upper left `corners`, as any-angle paths have it.
        close_corners: whether a square of 0.02 cells closes the gap of no width between two blocked
            cells that touch at a corner.
        limits: limits of segments other than the default ones.

    Raises:
        ValueError: a file in another format, a scenario of another map, a pair outside the map or
            on a blocked cell, or values that `Field` refuses; the message names file and line.
        OSError: a file cannot be read.
    """
    path = Path(path)
    scenario = Path(f"{path}.scen" if scenario is None else scenario)
    if points not in (CENTERS, CORNERS):
        raise ValueError(f"points are {CENTERS} or {CORNERS} of cells, got {points!r}")
    if not 0.0 < cell < np.inf:
        raise ValueError(f"a cell's side must be above 0 m, got {cell:g} m")
    blocked = read_cells(path)
    chosen = read_pairs(scenario, path, blocked, pairs)
    height, width = blocked.shape
    low, high = overlapping(blocked)
    if close_corners:
        squares = corner_squares(blocked)
        low, high = np.concatenate([low, squares[0]]), np.concatenate([high, squares[1]])
    # rows count downwards from the top, y upwards from the bottom
    obstacles = Obstacles.boxes(
        cell * np.stack([low[:, 0], height - high[:, 1]], axis=1),
        cell * np.stack([high[:, 0], height - low[:, 1]], axis=1),
    )
    shift = 0.5 if points == CENTERS else 0.0
    for pair in chosen:
        start, goal = (
            (cell * (column + shift), cell * (height - row - shift))
            for column, row in (pair.start, pair.goal)
        )
        try:
            yield Field(
                name=f"{path.stem}-{pair.number}",
                obstacles=obstacles,
                start=np.array(start),
                goal=np.array(goal),
                bounds=cell * np.array([[0.0, 0.0], [width, height]]),
                limits=Limits.of(dict(limits or {})),
            )
        except ValueError as error:
            raise ValueError(f"{scenario}, pair {pair.number}: {error}") from None


def read_cells(path: Path) -> NDArray[np.bool_]:
    """Whether each cell (rows, columns) of a map is blocked; row 0 is the uppermost.

    Raises:
        ValueError: not a map; the message names file and line.
        OSError: the file cannot be read.
    """
    lines = _text(path).splitlines()
    head = [line.split() for line in lines[:4]]
    kinds = [words[0] if words else "" for words in head]
    if kinds != ["type", "height", "width", "map"]:
        raise ValueError(
            f"{path}: not a MovingAI map, which begins with the lines type octile, height N, "
            "width N and map"
        )
    if head[0][1:] != ["octile"]:
        raise ValueError(
            f"{path}: the type in line 1 must be octile, whose letters stand for cells, got "
            f"{truncate_repr(' '.join(head[0][1:]))}"
        )
    try:
        height, width = (int(head[k][1]) for k in (1, 2))
    except (IndexError, ValueError):
        height = width = 0
    if not (height > 0 and width > 0 and height * width <= _MOST_CELLS):
        raise ValueError(
            f"{path}: height and width in lines 2 and 3 must be numbers from 1 on, of at most "
            f"{_MOST_CELLS} cells together"
        )
    rows = lines[4:]
    while rows and not rows[-1].strip():
        rows.pop()
    if len(rows) != height:
        raise ValueError(f"{path}: {len(rows)} rows follow, and the height in line 2 is {height}")
    for k, row in enumerate(rows):
        if len(row) != width:
            raise ValueError(
                f"{path}, line {k + 5}: {len(row)} cells, and the width in line 3 is {width}"
            )
        if unknown := set(row) - set(_PASSABLE + _BLOCKED):
            raise ValueError(
                f"{path}, line {k + 5}: unknown cell {min(unknown)!r}; cells are "
                f"{', '.join(_PASSABLE + _BLOCKED)}"
            )
    codes = np.frombuffer("".join(rows).encode("ascii"), np.uint8).reshape(height, width)
    blocked: NDArray[np.bool_] = np.isin(codes, np.frombuffer(_BLOCKED.encode(), np.uint8))
    return blocked


def read_pairs(
    scenario: Path, path: Path, blocked: NDArray[np.bool_], numbers: range | None
) -> list[Pair]:
    """The pairs of a scenario that have these numbers; None: all.

    Args:
        scenario: the file.
        path: that of the map.
        blocked: cells of the map.
        numbers: of the pairs, from 0.

    Raises:
        ValueError: not a scenario, that of another map, or a pair outside the map or on a blocked
            cell; the message names file and line.
        OSError: the file cannot be read.
    """
    if not scenario.exists():
        raise ValueError(f"no scenario {scenario} for {path}; name another with --scenario FILE")
    lines = _text(scenario).splitlines()
    if not lines or not lines[0].lower().startswith("version"):
        raise ValueError(f"{scenario}: not a MovingAI scenario, which begins with version 1")
    # names may have spaces where tabs separate
    split = [line.split("\t") if "\t" in line else line.split() for line in lines]
    rows = [(k, words) for k, words in enumerate(split[1:], 2) if any(words)]
    if not rows:
        raise ValueError(f"{scenario} has no pairs of start and goal behind its first line")
    if numbers is not None and not (numbers.start >= 0 and numbers.stop <= len(rows)):
        raise ValueError(
            f"{scenario} has pairs 0 to {len(rows) - 1}, not {numbers.start} to {numbers.stop - 1}"
        )
    height, width = blocked.shape
    pairs = []
    for number in range(len(rows)) if numbers is None else numbers:
        line, words = rows[number]
        where = f"{scenario}, line {line}"
        try:
            _, name, *rest = words
            columns, high, *places = map(int, rest[:6])
            x, y, u, v = places
            float(rest[6])
        except (ValueError, IndexError):
            raise ValueError(
                f"{where}: a pair has bucket, map, width, height, start x and y, goal x and y, and "
                f"length, got {truncate_repr(' '.join(words))}"
            ) from None
        if name.replace("\\", "/").rpartition("/")[2] != path.name:
            raise ValueError(f"{where}: the pair is of map {truncate_repr(name)}, not {path.name}")
        if (columns, high) != (width, height):
            raise ValueError(
                f"{where}: the pair is of a map of {columns} x {high} cells, and {path.name} has "
                f"{width} x {height}"
            )
        for what, (column, row) in (("start", (x, y)), ("goal", (u, v))):
            if not (0 <= column < width and 0 <= row < height):
                raise ValueError(f"{where}: {what} ({column}, {row}) lies outside {path.name}")
            if blocked[row, column]:
                raise ValueError(
                    f"{where}: {what} ({column}, {row}) is a blocked cell of {path.name}"
                )
        pairs.append(Pair(number, (x, y), (u, v)))
    return pairs


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not a text file: {error}") from None
