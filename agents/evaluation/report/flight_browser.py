"""Which flights a report shows, and their compact form: drawings in whole centimetres."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.flight_table import FlightTable
from agents.runtime.safe_npz import reason
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world import field_names
from ferguson_gym.world.field import BOUNDS, Field
from ferguson_gym.world.obstacles import Discs

BUDGET = 4_000_000
"""Characters that flights and fields may take."""
_FOR_FAILURES = 0.75
"""Part of the budget that failures may fill before the largest gaps have their turn."""
_FLIGHT = 60
"""Characters a flight takes beside its path, about."""
_SEGMENT = 8
"""Characters that a segment takes at least."""


def browser(
    flights: FlightTable, directory: Path, fields: Mapping[str, Field], budget: int = BUDGET
) -> dict[str, Any]:
    """What the browser of flights shows.

    All policies' flights through a field with one seed are a scene. Scenes with failures come
    first, rare failures before those of policies that often fail; then those with the largest
    gaps. What goes beyond the budget is left out, and `note` says so.

    Args:
        flights: of the directory.
        directory: holds paths.npz.
        fields: by name; those that are not there are redrawn if their name says how.
        budget: characters.

    Returns:
        `fields`, `scenes` (a field's index, a seed, runs), `total` scenes and `note`.

    Raises:
        ValueError: paths.npz does not belong to flights.csv, or is no such file.
    """
    paths = directory / "paths.npz"
    if not paths.is_file():
        return {"fields": [], "scenes": [], "total": 0, "note": "There is no paths.npz."}
    scenes = _scenes(flights)
    failing, by_gap = _ranked(flights, scenes)
    offsets = _offsets(paths, len(flights))
    least = {
        key: int((_FLIGHT + _SEGMENT * np.diff(offsets)[runs]).sum())
        for key, runs in scenes.items()
    }
    wanted = _at_most(failing, by_gap, least, budget)
    control = _cut(paths, offsets, sorted(k for key in wanted for k in scenes[key].tolist()))
    drawn_fields: dict[int, dict[str, Any]] = {}
    chosen: dict[tuple[int, int], dict[str, Any]] = {}
    used = 0
    for order, limit in ((failing, _FOR_FAILURES * budget), (by_gap, budget), (failing, budget)):
        for key in order:
            if used >= limit:
                break
            if key in chosen:
                continue
            field, seed = key
            if field not in drawn_fields:
                drawn = _field(flights.fields[field], fields)
                drawn_fields[field] = drawn
                used += 6 * len(drawn["discs"] or ()) + len(drawn["shortest"] or "") + 2 * _FLIGHT
            runs = [_run(flights, k, control[k]) for k in scenes[key].tolist()]
            used += sum(_FLIGHT + len(run["path"]) for run in runs)
            chosen[key] = {"field": field, "seed": flights.seeds[seed], "runs": runs}
    place = {field: k for k, field in enumerate(drawn_fields)}
    listed = [key for key in failing if key in chosen]
    failures = len(listed)
    rest = chosen.keys() - set(listed)
    listed += [key for key in by_gap if key in rest]
    return {
        "fields": list(drawn_fields.values()),
        "scenes": [{**chosen[key], "field": place[key[0]]} for key in listed],
        "total": len(scenes),
        "note": _note(len(listed), len(scenes), failures, len(failing)),
    }


def _note(shown: int, total: int, failing_shown: int, failing: int) -> str:
    if shown == total:
        return ""
    return (
        f"To stay small this page holds the flights of {shown} of {total} fields and seeds: "
        f"{failing_shown} of the {failing} with failures, rare ones first, and then the largest "
        "gaps. Tables and profiles are over all flights."
    )


def _at_most(
    failing: Sequence[tuple[int, int]],
    by_gap: Sequence[tuple[int, int]],
    least: Mapping[tuple[int, int], int],
    budget: int,
) -> set[tuple[int, int]]:
    """Scenes that can have a place, if each takes as few characters as it may."""
    found: set[tuple[int, int]] = set()
    for order, limit in ((failing, _FOR_FAILURES * budget), (by_gap, budget), (failing, budget)):
        used = 0
        for key in order:
            if used >= limit:
                break
            used += 0 if key in found else least[key]
            found.add(key)
    return found


def _offsets(path: Path, number: int) -> NDArray[np.int64]:
    # opened here: NumPy leaves a file open whose contents are no zip
    with (
        _opened(path),
        path.open("rb") as file,
        np.load(file, allow_pickle=False) as data,
    ):
        offsets: NDArray[np.int64] = data["offsets"]
        if offsets.ndim != 1 or offsets.dtype.kind != "i" or (np.diff(offsets) < 0).any():
            raise ValueError("offsets are whole numbers that grow")
    if len(offsets) != number + 1:
        raise ValueError(
            f"{path} has {len(offsets) - 1} flights and flights.csv has {number}: not of one "
            "evaluation"
        )
    return offsets


def _cut(path: Path, offsets: NDArray[np.int64], flights: Iterable[int]) -> dict[int, Array]:
    """The segments (n, 4, 2) of some flights, in order: the others' are read over."""
    with _opened(path), zipfile.ZipFile(path) as archive, archive.open("control.npy") as file:
        np.lib.format.read_magic(file)
        shape, _, kind = np.lib.format.read_array_header_1_0(file)
        if kind != np.float64 or shape != (int(offsets[-1]), 4, 2):
            raise ValueError(f"control is {shape} of {kind}, and offsets end on {offsets[-1]}")
        size, first = 8 * kind.itemsize, file.tell()
        cut = {}
        for k in flights:
            file.seek(first + size * int(offsets[k]))
            held = file.read(size * int(offsets[k + 1] - offsets[k]))
            cut[k] = np.frombuffer(held).reshape(-1, 4, 2)
        return cut


@contextmanager
def _opened(path: Path) -> Iterator[None]:
    """Turn what goes wrong with a file into one error that names it."""
    try:
        yield
    except Exception as error:  # of whatever the libraries make of a damaged file
        raise ValueError(f"{path} does not hold the paths of flights: {reason(error)}") from None


def _scenes(flights: FlightTable) -> dict[tuple[int, int], NDArray[np.int64]]:
    """Flights by field and seed, in the order of flights.csv."""
    together = flights.field * len(flights.seeds) + flights.seed
    order = np.argsort(together, kind="stable")
    kinds, begins = np.unique(together[order], return_index=True)
    parts = np.split(order, begins[1:]) if len(kinds) else []
    return {
        divmod(int(kind), len(flights.seeds)): part for kind, part in zip(kinds, parts, strict=True)
    }


def _ranked(
    flights: FlightTable, scenes: Iterable[tuple[int, int]]
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Scenes with failures, the most telling first; and all scenes, the largest gap first."""
    failed = ~flights.success
    failures = np.bincount(flights.policy[failed], minlength=len(flights.policies))
    telling: dict[tuple[int, int], float] = {}
    largest = dict.fromkeys(scenes, -math.inf)
    keys = list(zip(flights.field.tolist(), flights.seed.tolist(), strict=True))
    for k in np.flatnonzero(failed):
        share = 1.0 / float(failures[flights.policy[k]])
        telling[keys[k]] = telling.get(keys[k], 0.0) + share
    for k in np.flatnonzero(np.isfinite(flights.gap)):
        largest[keys[k]] = max(largest[keys[k]], float(flights.gap[k]))
    return (
        sorted(telling, key=lambda key: (-telling[key], key)),
        sorted(largest, key=lambda key: (-largest[key], key)),
    )


def _run(flights: FlightTable, k: int, control: Array) -> dict[str, Any]:
    gap = float(flights.gap[k])
    return {
        "policy": int(flights.policy[k]),
        "outcome": flights.outcome[k],
        "success": bool(flights.success[k]),
        "length": round(float(flights.length[k]), 2),
        "gap": round(gap, 6) if math.isfinite(gap) else None,
        "path": draw_chain(control),
    }


def draw_chain(control: Array) -> str:
    """Segments (n, 4, 2) as the data of an SVG path in centimetres, y upwards; may be empty.

    A Ferguson segment is the Bézier curve with control points a third of its derivatives from
    its ends; as neighbours share their derivatives, each after the first is a smooth curve.
    """
    if len(control) == 0:
        return ""
    start, end, departure, arrival = np.moveaxis(np.asarray(control), 1, 0)
    points = _centimetres(np.vstack([start[:1], end]))
    before = _centimetres(end - arrival / 3.0) - points[:-1]
    steps = np.diff(points, axis=0)
    first = _centimetres(start[0] + departure[0] / 3.0) - points[0]
    parts = [f"M{_pair(points[0])}c{_pair(first)} {_pair(before[0])} {_pair(steps[0])}"]
    rest = zip(before[1:], steps[1:], strict=True)
    parts.extend(f"s{_pair(middle)} {_pair(step)}" for middle, step in rest)
    return "".join(parts)


def draw_shortest(path: ShortestPath) -> str:
    """Lines and arcs as the data of an SVG path in centimetres, y upwards."""
    lines = _centimetres(path.lines)
    radii = _centimetres(path.radii)
    parts = [f"M{_pair(lines[0, 0])}L{_pair(lines[0, 1])}"]
    for k, sweep in enumerate(path.sweeps):
        large, left = int(sweep > math.pi), int(path.senses[k] > 0)
        parts.append(f"A{radii[k]} {radii[k]} 0 {large} {left} {_pair(lines[k + 1, 0])}")
        parts.append(f"L{_pair(lines[k + 1, 1])}")
    return "".join(parts)


def _field(name: str, fields: Mapping[str, Field]) -> dict[str, Any]:
    field = fields[name] if name in fields else _by_name(name)
    drawn: dict[str, Any] = {
        "name": name,
        "bounds": _centimetres(np.repeat(BOUNDS, 2)).tolist(),
        "start": None,
        "goal": None,
        "discs": None,
        "shortest": None,
    }
    if field is None or len(field.start) != 2:
        return drawn
    drawn["bounds"] = _centimetres(field.bounds).ravel().tolist()
    drawn["start"], drawn["goal"] = (_centimetres(p).tolist() for p in (field.start, field.goal))
    if isinstance(field.obstacles, Discs):
        discs = np.column_stack([field.obstacles.centers, field.obstacles.radii])
        drawn["discs"] = _centimetres(discs).ravel().tolist()
        shortest = shortest_path(field)
        drawn["shortest"] = None if shortest is None else draw_shortest(shortest)
    return drawn


def _by_name(name: str) -> Field | None:
    """A field that its name alone says how to draw; never a file, which may be another."""
    try:
        field_names.family(name)
        return field_names.get_field(name)
    except ValueError:
        return None


def _centimetres(metres: Array) -> NDArray[np.int64]:
    return np.rint(100.0 * np.asarray(metres)).astype(np.int64)


def _pair(point: Sequence[int] | NDArray[np.int64]) -> str:
    # a minus sign parts numbers as well as a space does
    return f"{point[0]} {point[1]}".replace(" -", "-")
