"""Statistics of an evaluation, in tables for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from agents.tables import empty_table

_NONE = "-"
_INFINITE = "inf"


def policies(found: Mapping[str, Any]) -> Table:
    """A row for each policy, the highest SPL first; intervals in brackets.

    Args:
        found: as `agents.statistics.summary` returns it.
    """
    table = empty_table(
        "Policies, with 95 % intervals",
        "policy",
        "success [%]",
        "SPL",
        "gap, median [%]",
        "interquartile mean [%]",
        "99 % [%]",
        caption="failures count 0 in SPL and as infinite gaps; intervals over fields, and over "
        "policy seeds where there are several",
    )
    for one in sorted(found["policies"], key=lambda one: -float(one["spl"])):
        mean = _gap(one, "gap_iqm")
        if one["gap_iqm_low"] is not None:
            mean += f" ({_percent(one['gap_iqm_low'])} to {_gap(one, 'gap_iqm_high')})"
        table.add_row(
            Text(one["policy"]),
            _with_interval(one, "success", lambda share: f"{100.0 * share:.1f}"),
            _with_interval(one, "spl", lambda share: f"{share:.4f}"),
            _gap(one, "gap_median"),
            mean,
            _gap(one, "gap_99"),
        )
    return table


def against_the_best(found: Mapping[str, Any]) -> Table | None:
    """The policy with the highest SPL in pairs with all others; None if there are none."""
    if not found["pairs"]:
        return None
    best = max(found["policies"], key=lambda one: float(one["spl"]))["policy"]
    table = empty_table(
        f"{best} in pairs with the others, on the same fields and seeds",
        "against",
        "SPL difference",
        "shorter [%]",
        "won : lost",
        "McNemar p",
        "Holm p",
        caption="shorter: in which share of flights, ties half, a failure loses against any "
        "success; won, lost: fields on which only one of the two arrives",
    )
    rows = [pair for pair in found["pairs"] if best in (pair["first"], pair["second"])]
    for pair in rows:
        turned = pair["second"] == best
        wins = pair["first_wins"], pair["second_wins"]
        table.add_row(
            Text(pair["first"] if turned else pair["second"]),
            _with_interval(
                _turned(pair, "spl_difference", 0.0) if turned else pair,
                "spl_difference",
                lambda difference: f"{difference:+.4f}",
            ),
            _with_interval(
                _turned(pair, "improvement", 1.0) if turned else pair,
                "improvement",
                lambda share: f"{100.0 * share:.1f}",
            ),
            " : ".join(map(str, wins[::-1] if turned else wins)),
            *(_chance(pair[key]) for key in ("mcnemar_p", "mcnemar_p_holm")),
        )
    return table if rows else None


def _turned(pair: Mapping[str, Any], key: str, whole: float) -> dict[str, float | None]:
    """A value and its interval, seen from the second policy's side."""
    low, high = pair[f"{key}_low"], pair[f"{key}_high"]
    return {
        key: whole - pair[key],
        f"{key}_low": None if high is None else whole - high,
        f"{key}_high": None if low is None else whole - low,
    }


def _with_interval(one: Mapping[str, Any], key: str, told: Callable[[float], str]) -> str:
    low, high = one[f"{key}_low"], one[f"{key}_high"]
    if low is None or high is None:
        return told(one[key])
    return f"{told(one[key])} ({told(low)} to {told(high)})"


def _gap(one: Mapping[str, Any], key: str) -> str:
    if one[key] is None:
        return _INFINITE if one["gap_flights"] else _NONE
    return _percent(one[key])


def _chance(p: float) -> str:
    return f"{p:.4f}" if p >= 1e-4 else "< 0.0001"


def _percent(share: float) -> str:
    # a shortest path is not a little shorter than itself
    return f"{round(100.0 * share, 2) + 0.0:.2f}"
