"""Parts of summary.json other than statistics: shields, the paper's fields, and measured times."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.request import Request
from agents.flights.flight_table import SHIELD, FlightTable
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.shortest_paths import exact_length
from planners.reachability import why_unreachable


def shields(flights: FlightTable) -> list[dict[str, Any]]:
    """For each shielded policy, how many steps the planner took over, and why: JSON values."""
    agent = SHIELD.index(ShieldDecision.AGENT)
    found = []
    for k, policy in enumerate(flights.policies):
        steps = flights["shield_steps"][flights.policy == k]
        if not steps.any():
            continue
        totals = dict(zip(SHIELD, steps.sum(axis=0).tolist(), strict=True))
        number = sum(totals.values())
        causes = {cause.label: count for cause, count in totals.items() if count}
        causes.pop(ShieldDecision.AGENT.label, None)
        found.append(
            {
                "policy": policy,
                "flights": len(steps),
                "untouched_flights": int((steps[:, agent] == steps.sum(axis=1)).sum()),
                "steps": number,
                "handed_over": number - totals[ShieldDecision.AGENT],
                "causes": dict(sorted(causes.items(), key=lambda item: -item[1])),
            }
        )
    return found


def on_paper(flights: FlightTable) -> list[dict[str, Any]]:
    """For each policy and field of the paper, medians over successful flights: JSON values."""
    known = flights["from_paper"]
    pairs = zip(flights.policy[known].tolist(), flights.field[known].tolist(), strict=True)
    found = []
    for policy, field in dict.fromkeys(pairs):
        mine = (flights.policy == policy) & (flights.field == field)
        solved = mine & flights.success
        exact = float(flights["exact_length"][mine][0])
        found.append(
            {
                "policy": flights.policies[policy],
                "field": flights.fields[field],
                "flights": int(mine.sum()),
                "successes": int(solved.sum()),
                "segments": _median(flights["segments"][solved]),
                "evaluations": _median(flights["evaluations"][solved]),
                "length": _median(flights["length"][solved]),
                "exact_length": None if np.isnan(exact) else exact,
            }
        )
    return found


def unreachable(request: Request, flights: FlightTable) -> list[dict[str, str]]:
    """The fields whose goal no flight can reach, each with a status and a message: JSON values.

    Among drawn fields with the default limits, only those without a shortest path to compare with
    are looked at.
    """
    exact = flights.grid(flights["exact_length"])[0, :, 0]
    found = []
    for source, length in zip(request.fields, exact.tolist(), strict=True):
        known = not math.isnan(length)
        if known and isinstance(source, str) and not request.changes.limits:
            continue
        field = request.field(source)
        why = why_unreachable(field, length if known else exact_length(field))
        if why is not None:
            status, reason = why
            message = "; ".join(filter(None, (status.sentence, reason)))
            found.append({"field": field.name, "status": status.label, "message": message})
    return found


def recorded_knowledge(summary: Mapping[str, Any]) -> dict[str, object]:
    """What each policy knows, as the statistics in a summary.json say, which may be malformed."""
    found = summary.get("statistics")
    listed = found.get("policies") if isinstance(found, dict) else None
    every = listed if isinstance(listed, list) else []
    return {
        one["policy"]: one.get("knows")
        for one in every
        if isinstance(one, dict) and isinstance(one.get("policy"), str)
    }


def _median(values: NDArray[Any]) -> float | None:
    return float(np.median(values)) if len(values) else None


TIMES = ("decision_seconds_median", "decision_seconds_99", "flight_seconds_median")
"""Entries of a summary that `agents.evaluation.timing` measures."""


def timed(
    policies: Iterable[Mapping[str, Any]], measured_policies: Iterable[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Statistics of policies with the times that were measured while nothing else ran.

    These are in `policies` of summary.json; a time that is missing there stays as it is.
    """
    measured = {one.get("policy"): one for one in measured_policies}
    return [
        {**one, **{key: measured[one["policy"]].get(key, one.get(key)) for key in TIMES}}
        if one["policy"] in measured
        else dict(one)
        for one in policies
    ]
