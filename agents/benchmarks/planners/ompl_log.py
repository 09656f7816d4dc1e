"""Writes plans in the log format of OMPL's benchmarks, read by its statistics and Planner Arena.

A log is one experiment; each pair of a field and a seed is a run of it.

Reference:
    The grammar in OMPL's documentation, "How to benchmark planners"; Moll, Şucan & Kavraki
    (2015), Benchmarking motion planning algorithms, IEEE Robotics & Automation Magazine 22(3).
"""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Iterator, Sequence
from datetime import datetime

from agents.benchmarks.planners.runs import FALSE_SUCCESS, LIBRARIES, Run
from agents.runtime import provenance
from ferguson_gym import __version__
from planners.interface import Status

STATUSES = (*(status.label for status in Status), FALSE_SUCCESS)
"""Labels of the values of the property status."""
_RUN = {
    "field INTEGER": "field",
    "seed INTEGER": "seed",
    "status INTEGER": "status",
    "solved BOOLEAN": "success",
    "time REAL": "seconds",
    "time to first solution REAL": "seconds_first",
    "solution length REAL": "length",
    "route length REAL": "raw_length",
    "exact length REAL": "exact_length",
    "gap REAL": "gap",
    "route gap REAL": "raw_gap",
    "solution clearance REAL": "clearance",
    "solution segments INTEGER": "segments",
    "minimum turn radius REAL": "min_turn_radius",
    "bending REAL": "bending",
    "evaluations INTEGER": "evaluations",
}
"""Properties of a run, and the attributes of `Run` that they come from."""
_PROGRESS = ("time REAL", "best cost REAL")


def write(
    runs: Sequence[Run], began: datetime, total_seconds: float, seconds: float | None
) -> Iterator[str]:
    """The lines of a log, each without its end; each planner's runs keep their order.

    `total_seconds` is the duration of the experiment [s], `seconds` the search time of planners
    with a budget [s]; None: their own budgets.
    """
    fields = list(dict.fromkeys(run.field.name for run in runs))
    planners = list(dict.fromkeys(run.planner for run in runs))
    yield f"ferguson-gym version {__version__}"
    yield "Experiment ferguson"
    yield f"Running on {_word(platform.node()) or 'unknown'}"
    yield f"Starting at {began:%Y-%m-%d %H:%M:%S}"
    yield from _block("a path through discs, fitted with Ferguson segments; limits of 0: none")
    yield from _block(json.dumps(provenance.facts(*LIBRARIES)))
    yield f"{min(run.seed for run in runs)} is the random seed"
    yield f"{0.0 if seconds is None else seconds!r} seconds per run"
    yield "0.0 MB per run"
    yield f"{len(runs) // len(planners)} runs per planner"
    yield f"{total_seconds!r} seconds spent to collect the data"
    yield "2 enum type"
    yield "|".join(["status", *STATUSES])
    yield "|".join(["field", *(_word(name) for name in fields)])
    yield f"{len(planners)} planners"
    for planner in planners:
        mine = [run for run in runs if run.planner == planner]
        yield _word(planner)
        yield "0 common properties"
        yield f"{len(_RUN)} properties for each run"
        yield from _RUN
        yield f"{len(mine)} runs"
        for run in mine:
            yield "".join(f"{_datum(value)}; " for value in _measured(run, fields))
        if any(run.improved for run in mine):
            yield f"{len(_PROGRESS)} progress properties for each run"
            yield from _PROGRESS
            yield f"{len(mine)} runs"
            for run in mine:
                yield "".join(f"{when!r},{length!r},;" for when, length in _progress(run))
        yield "."


def _measured(run: Run, fields: Sequence[str]) -> list[float | None]:
    """The values of the properties in `_RUN`; fields and statuses by index."""
    values = {name: getattr(run, name) for name in _RUN.values()}
    values["field"], values["status"] = fields.index(run.field.name), STATUSES.index(run.status)
    values["evaluations"] = run.evaluations or 0
    return list(values.values())


def _progress(run: Run) -> list[tuple[float, float]]:
    """Times and lengths, one for each time, since readers reject repeated times."""
    return [] if run.route is None else list(dict(run.route.progress).items())


def _datum(value: float | None) -> str:
    if value is None:
        return ""
    if isinstance(value, int):  # booleans included
        return str(int(value))
    return repr(float(value)) if math.isfinite(value) else "inf"


def _word(text: str) -> str:
    """A name without blanks and bars, which the format does not allow."""
    return re.sub(r"[\s|]+", "_", text)


def _block(text: str) -> tuple[str, str, str]:
    return "<<<|", text, "|>>>"
