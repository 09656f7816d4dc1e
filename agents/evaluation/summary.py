"""What a summary tells of flights beside statistics: whose hands, the paper's, what they cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from agents.evaluation.records import Record
from agents.policies.shield_decisions import ShieldDecision, share_handed_over


def shields(flights: Sequence[Record]) -> list[dict[str, Any]]:
    """Of each shielded policy, how much of its flights was handed over, and why: JSON values."""
    told = []
    for policy in dict.fromkeys(flight.policy for flight in flights if flight.hands):
        flown = [flight.hands for flight in flights if flight.policy == policy]
        hands = [hand for steps in flown for hand in steps]
        causes = Counter(hand.label for hand in hands if hand is not ShieldDecision.AGENT)
        told.append(
            {
                "policy": policy,
                "flights": len(flown),
                "untouched_flights": sum(share_handed_over(steps) == 0.0 for steps in flown),
                "steps": len(hands),
                "handed_over": sum(causes.values()),
                "causes": dict(causes.most_common()),
            }
        )
    return told


def on_paper(flights: Sequence[Record]) -> list[dict[str, Any]]:
    """Of each policy on each of the paper's fields, medians over its successes: JSON values."""
    known = [flight for flight in flights if flight.from_paper]
    told = []
    for policy, field in dict.fromkeys((flight.policy, flight.field) for flight in known):
        flown = [one for one in known if (one.policy, one.field) == (policy, field)]
        arrived = [flight for flight in flown if flight.success]
        told.append(
            {
                "policy": policy,
                "field": field,
                "flights": len(flown),
                "successes": len(arrived),
                "segments": _median([flight.segments for flight in arrived]),
                "evaluations": _median([flight.evaluations for flight in arrived]),
                "length": _median([flight.length for flight in arrived]),
                "exact_length": flown[0].exact_length,
            }
        )
    return told


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


TIMES = ("decision_seconds_median", "decision_seconds_99", "flight_seconds_median")
"""What `agents.evaluation.timing` measures, as a summary has it."""


def timed(
    policies: Iterable[Mapping[str, Any]], told: Iterable[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Statistics of policies with the times that were measured when nothing else flew.

    Args:
        policies: as `agents.evaluation.statistics.summary` has them, with times as they flew.
        told: `policies` of summary.json; where it does not tell a time, the other one stays.
    """
    measured = {one.get("policy"): one for one in told}
    return [
        {**one, **{key: measured[one["policy"]].get(key, one.get(key)) for key in TIMES}}
        if one["policy"] in measured
        else dict(one)
        for one in policies
    ]
