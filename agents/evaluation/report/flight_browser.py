"""Which flights a report shows, and in which order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.report.svg import draw_chain, draw_field
from agents.evaluation.results import Paths
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.flights.flight_table import FlightTable
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Outcome

BUDGET = 4_000_000
"""Characters that flights and fields may take."""
_FOR_FAILURES = 0.75
"""Share of the budget that failures may fill before the largest gaps are added."""
_FLIGHT = 60
"""Characters of a flight beside its path, about."""
_SEGMENT = 8
"""Minimum number of characters of a segment."""
_NO_PATHS = "No flights are shown, because paths.npz is missing."


class Scene(NamedTuple):
    """All policies' flights through one field with one policy seed."""

    field: int
    """Index among the table's fields."""
    seed: int
    """Index among the table's seeds."""


@dataclass(frozen=True, slots=True)
class Ranking:
    """Scenes in the order in which they are shown."""

    failing: Sequence[Scene]
    """Those with failures; rare failures come before those of policies that often fail."""
    by_gap: Sequence[Scene]
    """All, the largest gap first."""

    def within(self, budget: int) -> Iterator[tuple[Scene, float]]:
        """Scenes, and the characters up to which each may still be added."""
        passes = (
            (self.failing, _FOR_FAILURES * budget),
            (self.by_gap, budget),
            (self.failing, budget),
        )
        for scenes, limit in passes:
            for scene in scenes:
                yield scene, limit


def browser(
    flights: FlightTable,
    paths: Paths | None,
    fields: Mapping[str, Field],
    budget: int = BUDGET,
    changes: FieldChanges = UNCHANGED,
) -> dict[str, Any]:
    """The data of the flight browser.

    Scenes with failures come first, then those with the largest gaps. Scenes beyond the budget
    [characters] are left out, and `note` says so. A field that is not in `fields` is drawn if its
    name defines it; all are drawn with their `changes`.

    Returns:
        `fields`, `scenes` (a field's index, a seed, runs), `total` scenes and `note`.

    Raises:
        ValueError: The paths are damaged.
    """
    if paths is None:
        return {"fields": [], "scenes": [], "total": 0, "note": _NO_PATHS}
    scenes = _scenes(flights)
    ranking = _rank(flights, list(scenes))
    drawn_fields, chosen = _choose(flights, paths, fields, scenes, ranking, budget, changes)
    order = [scene for scene in ranking.failing if scene in chosen]
    failing = set(order)
    order += [scene for scene in ranking.by_gap if scene in chosen and scene not in failing]
    place = {field: k for k, field in enumerate(drawn_fields)}
    return {
        "fields": list(drawn_fields.values()),
        "scenes": [
            {"field": place[one.field], "seed": flights.seeds[one.seed], "runs": chosen[one]}
            for one in order
        ],
        "total": len(scenes),
        "note": _note(len(order), len(scenes), len(failing), len(ranking.failing)),
    }


def _note(shown: int, total: int, failing_shown: int, failing: int) -> str:
    if shown == total:
        return ""
    return (
        f"To limit its size, this page contains the flights of {shown} of {total} pairs of field "
        f"and seed: {failing_shown} of the {failing} with failures, beginning with failures of "
        "policies that rarely fail, and then those with the largest gaps. Tables and profiles "
        "cover all flights."
    )


def _choose(
    flights: FlightTable,
    paths: Paths,
    fields: Mapping[str, Field],
    scenes: Mapping[Scene, NDArray[np.int64]],
    ranking: Ranking,
    budget: int,
    changes: FieldChanges,
) -> tuple[dict[int, dict[str, Any]], dict[Scene, list[dict[str, Any]]]]:
    """Drawings of the fields by index, and of the flights by scene, that fit into the budget."""
    possible = _at_most(paths.segments, scenes, ranking, budget)
    control = paths.control(sorted(k for one in possible for k in scenes[one].tolist()))
    drawn: dict[int, dict[str, Any]] = {}
    chosen: dict[Scene, list[dict[str, Any]]] = {}
    used = 0
    for scene, limit in ranking.within(budget):
        if used >= limit or scene in chosen:
            continue
        if scene.field not in drawn:
            field = draw_field(flights.fields[scene.field], fields, changes)
            drawn[scene.field] = field
            used += 6 * len(field["discs"] or ()) + len(field.get("shapes", ""))
            used += len(field["shortest"] or "") + 2 * _FLIGHT
        runs = [_run(flights, k, control[k]) for k in scenes[scene].tolist()]
        used += sum(_FLIGHT + len(run["path"]) for run in runs)
        chosen[scene] = runs
    return drawn, chosen


def _at_most(
    segments: NDArray[np.int64],
    scenes: Mapping[Scene, NDArray[np.int64]],
    ranking: Ranking,
    budget: int,
) -> set[Scene]:
    """The scenes that would fit if each segment took as few characters as it can."""
    found: set[Scene] = set()
    used, limit = 0, -1.0
    for scene, current in ranking.within(budget):
        if current != limit:  # each pass counts from the start, so that it misses no scene
            used, limit = 0, current
        if used < limit and scene not in found:
            used += int((_FLIGHT + _SEGMENT * segments[scenes[scene]]).sum())
            found.add(scene)
    return found


def _scenes(flights: FlightTable) -> dict[Scene, NDArray[np.int64]]:
    """Indices of the flights in each scene, in the order of the table."""
    together = flights.field * len(flights.seeds) + flights.seed
    order = np.argsort(together, kind="stable")
    kinds, begins = np.unique(together[order], return_index=True)
    parts = np.split(order, begins[1:]) if len(kinds) else []
    return {
        Scene(*divmod(int(kind), len(flights.seeds))): part
        for kind, part in zip(kinds, parts, strict=True)
    }


def _rank(flights: FlightTable, scenes: Sequence[Scene]) -> Ranking:
    success, gaps = flights.success, flights["gap"]
    failures = np.bincount(flights.policy[~success], minlength=len(flights.policies))
    rarity: dict[Scene, float] = {}
    largest = dict.fromkeys(scenes, -math.inf)
    places = zip(flights.field.tolist(), flights.seed.tolist(), strict=True)
    for k, scene in enumerate(map(Scene._make, places)):
        if not success[k]:
            rarity[scene] = rarity.get(scene, 0.0) + 1.0 / float(failures[flights.policy[k]])
        if math.isfinite(gaps[k]):
            largest[scene] = max(largest[scene], float(gaps[k]))
    return Ranking(
        failing=sorted(rarity, key=lambda scene: (-rarity[scene], scene)),
        by_gap=sorted(largest, key=lambda scene: (-largest[scene], scene)),
    )


def _run(flights: FlightTable, k: int, control: Array) -> dict[str, Any]:
    gap = float(flights["gap"][k])
    return {
        "policy": int(flights.policy[k]),
        "outcome": Outcome.from_code(int(flights["outcome"][k])).label,
        "success": bool(flights["outcome"][k] == Outcome.GOAL_REACHED.code),
        "length": round(float(flights["length"][k]), 2),
        "gap": round(gap, 6) if math.isfinite(gap) else None,
        "path": draw_chain(control),
    }
