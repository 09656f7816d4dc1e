"""The paper's claims, tested: variants of its planner on the same fields, side by side.

Run it from a checkout:

    .venv/bin/python benchmarks/paper_claims.py --fields standard/validation:0-499 --workers 2 \
        --out docs/images/claims.png

Each variant flies the planner's own rollout, whose segments are flown and certified as the
environment does it, with the variant's own limits. Times are processor times, and variants take
turns on each field, so that other work on the machine hits all alike. Failures count: as 0 in SPL,
as failures in success; lengths and times of flights are compared where both arrived. Intervals are
for 95 %, over fields: Wilson's for success, bootstrap for all else, paired with the reference of
the group.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from paper_claims_picture import draw
from paper_claims_variants import GROUPS, REFERENCE, SINGLE, Row, Variant

from agents.evaluation.bootstrap import percentiles, resampled_means
from agents.evaluation.statistics import mcnemar
from agents.flights.metrics import Interval, path_share, success_interval
from agents.plots.flight_grid import check_target
from agents.policies.warm_up import warm
from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from planners.interface import Plan, initial_state


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """The measurements of one flight."""

    success: bool
    length: float
    """Flown [m]."""
    spl: float
    """Its part in SPL."""
    seconds: float
    """Processor time, of the flight [s]."""
    windows: int
    """Decided."""
    evaluations: float
    """Of the objective, a window."""
    reach: float
    """By how much a window's end is nearer to the goal than its beginning, mean [m]."""
    winding: float
    """Length of a window over the straight distance between its ends, mean."""


def told(plan: Plan, field: Field, seconds: float) -> Flown:
    """The measurements of a plan, and of its windows that did not yet end on the goal."""
    exact = exact_length(field)
    flown = float(length(plan.control).sum()) if len(plan.control) else 0.0
    windows = [
        decision.chain
        for decision in plan.decisions
        if decision.chain is not None and not np.array_equal(decision.chain[-1, 1], field.goal)
    ]
    reaches = [
        _distance(field.goal, one[0, 0]) - _distance(field.goal, one[-1, 1]) for one in windows
    ]
    windings = [
        float(length(one).sum()) / max(_distance(one[0, 0], one[-1, 1]), 1e-6) for one in windows
    ]
    return Flown(
        success=plan.success,
        length=flown,
        spl=float(path_share(plan.success, flown, exact)),
        seconds=seconds,
        windows=len(plan.decisions),
        evaluations=plan.evaluations / len(plan.decisions),
        reach=float(np.mean(reaches)) if reaches else np.nan,
        winding=float(np.median(windings)) if windings else np.nan,
    )


def _distance(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other))


def variants() -> dict[str, Variant]:
    """All variants by name, the reference once."""
    return {name: one for group in GROUPS.values() for name, one in group.items()}


def fly(field: Field, index: int, count: int) -> dict[str, Flown]:
    """All variants through one of so many fields, each by the processor's clock."""
    warm("multi-start")
    flights = {}
    for name, variant in variants().items():
        if index < variant.share * count:
            began = time.process_time()
            flown = replace(field, limits=variant.limits)
            plan = variant.planner.plan(flown, initial_state(flown), 0)
            flights[name] = told(plan, flown, time.process_time() - began)
    return flights


def rows(flights: Sequence[dict[str, Flown]]) -> list[Row]:
    """The table, group by group.

    Args:
        flights: of each field, by variant.
    """
    found = []
    for group, members in GROUPS.items():
        known = [name for name in members if name in (REFERENCE, SINGLE)]
        reference = known[0] if known else next(iter(members))
        for name in members:
            both = [(one[name], one[reference]) for one in flights if name in one]
            found.append(_row(group, name, both))
    return found


def _row(group: str, name: str, both: Sequence[tuple[Flown, Flown]]) -> Row:
    mine = [one for one, _ in both]
    arrived = [one.success for one in mine]
    wins = sum(one.success and not other.success for one, other in both)
    losses = sum(other.success and not one.success for one, other in both)
    longer = [
        one.length / other.length - 1.0 if one.success and other.success else np.nan
        for one, other in both
    ]
    ratios = [np.log(one.seconds / other.seconds) for one, other in both]
    slower = [
        ratio - np.log(one.windows / other.windows)
        for ratio, (one, other) in zip(ratios, both, strict=True)
    ]
    costlier = [
        ratio if one.success and other.success else np.nan
        for ratio, (one, other) in zip(ratios, both, strict=True)
    ]
    spl, spl_interval = _mean([one.spl for one in mine])
    more, more_interval = _mean(longer)
    ratio, ratio_interval = _mean(slower)
    return Row(
        group=group,
        variant=name,
        fields=len(both),
        success=float(np.mean(arrived)),
        success_interval=success_interval(sum(arrived), len(arrived)),
        mcnemar=mcnemar(wins, losses),
        spl=spl,
        spl_interval=spl_interval,
        longer=more,
        longer_interval=more_interval,
        slower=float(np.exp(ratio)),
        slower_interval=ratio_interval and Interval(*np.exp(ratio_interval)),
        costlier=float(np.exp(_mean(costlier)[0])),
        evaluations=float(np.mean([one.evaluations for one in mine])),
        reach=float(np.nanmean([one.reach for one in mine])),
        winding=float(np.nanmedian([one.winding for one in mine])),
    )


def _mean(values: Sequence[float]) -> tuple[float, Interval | None]:
    """The mean and its interval; NaN does not count."""
    known = np.array(values, float)
    known = known[~np.isnan(known)]
    if not len(known):
        return float("nan"), None
    drawn = resampled_means(known[None, :, None], 0)[:, 0]
    return float(known.mean()), percentiles(drawn, len(known))


def markdown(table: Sequence[Row]) -> str:
    """The table as docs/claims.md has it."""
    lines = []
    for group in GROUPS:
        lines += [
            f"**{group}**",
            "",
            "| variant | fields | success (95 %) | McNemar p | SPL | longer than the reference "
            "| time per window | time per flight | evaluations per window | reach [m] | winding |",
            "| --- |" + " ---: |" * 10,
        ]
        for row in table:
            if row.group == group:
                low, high = row.success_interval
                lines.append(
                    f"| {row.variant} | {row.fields} | {100 * row.success:.1f} % "
                    f"({100 * low:.1f} to {100 * high:.1f}) | {_chance(row.mcnemar)} "
                    f"| {row.spl:.3f}{_told(row.spl_interval, '{:.3f}')} "
                    f"| {_longer(row)} "
                    f"| x {row.slower:.2f}{_told(row.slower_interval, '{:.2f}')} "
                    f"| {_times(row.costlier)} | {row.evaluations:.0f} | {row.reach:.1f} "
                    f"| {row.winding:.4f} |"
                )
        lines.append("")
    return "\n".join(lines)


def _longer(row: Row) -> str:
    if np.isnan(row.longer):
        return "-"
    return f"{100 * row.longer:+.2f} %{_told(row.longer_interval, '{:+.2f}', 100)}"


def _times(ratio: float) -> str:
    return "-" if np.isnan(ratio) else f"x {ratio:.2f}"


def _chance(p: float) -> str:
    return "< 0.001" if p < 1e-3 else f"{p:.3f}"


def _told(interval: Interval | None, how: str, times: float = 1.0) -> str:
    if interval is None:
        return ""
    low, high = (how.format(times * end) for end in interval)
    return f" ({low} to {high})"


def main() -> None:
    """Fly, print the table, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--fields", default="standard/validation:0-499", metavar="SPEC")
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the picture")
    given = parser.parse_args()
    try:
        fields = list(get_fields(given.fields))
        if given.out is not None:
            check_target(given.out)
    except ValueError as error:
        parser.error(str(error))
    tasks = (delayed(fly)(field, k, len(fields)) for k, field in enumerate(fields))
    flights = []
    for one in Parallel(n_jobs=given.workers, return_as="generator")(tasks):
        flights.append(one)
        if len(flights) % 10 == 0:
            print(f"{len(flights)} of {len(fields)} fields", file=sys.stderr, flush=True)
    table = rows(flights)
    print(markdown(table))
    if given.out is not None:
        draw(table, given.out)


if __name__ == "__main__":
    main()
