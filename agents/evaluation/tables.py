"""The tables of an evaluation's summary, as the terminal shows them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from rich.table import Table

from agents.evaluation.statistics import caution
from agents.evaluation.summary import recorded_knowledge, timed
from agents.flights.field_changes import FieldChanges
from agents.policies.knowledge import LEGEND, UNKNOWN, Knows, grouped, labels
from agents.runtime.terminal_tables import NONE, add_group, decimal, empty_table
from ferguson_gym.world import Outcome
from ferguson_gym.world.paper_fields import TABLE_I

_TO = "\N{EN DASH}"
_INFINITE = "inf"
_FEW = 3
"""Number of fields whose goal no flight can reach that are named."""
_OUTCOMES = {outcome.label: outcome.sentence for outcome in Outcome}


def of_summary(summary: Mapping[str, Any]) -> Iterator[Table | str]:
    """Tables and sentences on a summary.json, in the order in which they are shown."""
    found = summary["statistics"]
    found = {**found, "policies": timed(found["policies"], summary["policies"])}
    # older summaries do not record what policies know
    knows = labels([one["policy"] for one in found["policies"]], recorded_knowledge(summary))
    yield policies(found, knows)
    remarks = [
        *changes(summary),
        *failures(found),
        *beyond_reach(summary.get("unreachable", ())),
        *without_gap(found),
        *filter(None, [caution(found)]),
        *(
            f"{one['policy']} has a time limit, so its flights are not exactly reproducible"
            for one in summary["policies"]
            if one["stopped_by_clock"]
        ),
    ]
    if remarks:
        yield ""
        yield from remarks
    shielded, on_paper = summary.get("shields", ()), summary.get("paper", ())
    for table in (against_the_best(found, knows), shields(shielded, knows), paper(on_paper, knows)):
        if table is not None:
            yield ""
            yield table


def policies(found: Mapping[str, Any], knows: Knows) -> Table:
    """A row for each policy of a summary's statistics, the highest SPL first in each group."""
    fields, seeds = found["fields"], found["seeds"]
    table = empty_table(
        f"{_number(fields, 'field')}, {_number(seeds, 'policy seed')}; 95 % intervals in brackets",
        "policy",
        "success\n[%]",
        "SPL",
        "median\ngap [%]",
        "99th pct.\ngap [%]",
        "decision\n99th [ms]",
        "flight\n[ms]",
        caption="SPL: mean of shortest / flown length, where failures count 0; gap: flown / "
        "shortest length - 1, infinite for a failure; decision: 99th percentile of decision times, "
        "including the first, in which a whole-path planner plans its whole path; flight: median "
        f"time of a whole flight\n{LEGEND}",
        broken=("success\n[%]", "SPL"),
    )
    _add(
        table,
        sorted(found["policies"], key=lambda one: -float(one["spl"])),
        knows,
        lambda one: (
            one["policy"],
            _with_interval(one, "success", _share),
            _with_interval(one, "spl", "{:.3f}".format),
            _gap(one, "gap_median"),
            _gap(one, "gap_99"),
            _milliseconds(one.get("decision_seconds_99")),
            _milliseconds(one["flight_seconds_median"]),
        ),
    )
    return table


def failures(found: Mapping[str, Any]) -> Iterator[str]:
    """A sentence for each policy that failed: how often, and how."""
    for one in found["policies"]:
        causes = {
            _OUTCOMES.get(label, label): number
            for label, number in one["outcomes"].items()
            if label != Outcome.GOAL_REACHED.label
        }
        if causes:
            listed = ", ".join(f"{number} x {cause}" for cause, number in causes.items())
            yield f"{one['policy']} failed {sum(causes.values())} of {one['flights']}: {listed}"


def changes(summary: Mapping[str, Any]) -> Iterator[str]:
    """A sentence on how fields were changed, if they were."""
    if made := FieldChanges.of_json(summary.get("configuration", {})):
        yield f"changes to all fields, also for their shortest paths: {made}"


def beyond_reach(fields: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A sentence for each field whose goal no flight can reach, for the first few of them."""
    for one in fields[:_FEW]:
        yield f"{one['field']}: {one['message']}"
    if len(fields) > _FEW:
        yield f"likewise, no flight can reach the goal of {len(fields) - _FEW} other fields"


def without_gap(found: Mapping[str, Any]) -> Iterator[str]:
    """A sentence on flights that cannot have a gap, if there are any."""
    flights = sum(one["flights"] - one["gap_flights"] for one in found["policies"])
    if flights:
        yield (
            f"no shortest path to compare with for {_number(flights, 'flight')}: they are left out "
            "of gaps, and count 0 in SPL"
        )


def against_the_best(found: Mapping[str, Any], knows: Knows) -> Table | None:
    """Comparisons of the policy with the highest SPL with each other policy.

    None if there is no other policy, or only one field, which says nothing about others.
    """
    if not found["pairs"] or found["fields"] < 2:
        return None
    best = max(found["policies"], key=lambda one: float(one["spl"]))["policy"]
    table = empty_table(
        f"{best} ({knows[best] or UNKNOWN}) compared with the others, on the same fields and seeds",
        "compared with",
        "SPL difference",
        "P(shorter)\n[%]",
        "won : lost",
        "McNemar p",
        caption=f"P(shorter): share of flights in which {best} flies the shorter path; ties count "
        "half, and a failure loses against any success; won, lost: fields on which only one of the "
        "two succeeds; McNemar p: exact test of won against lost, adjusted by Holm for all pairs",
    )
    spl = {one["policy"]: float(one["spl"]) for one in found["policies"]}
    rows = [pair for pair in found["pairs"] if best in (pair["first"], pair["second"])]
    rows = sorted(rows, key=lambda pair: -spl[pair["first"]] - spl[pair["second"]])
    seen = [pair if pair["first"] == best else _turned(pair) for pair in rows]
    _add(
        table,
        [{"policy": pair["second"], **pair} for pair in seen],
        knows,
        lambda one: (
            one["policy"],
            _with_interval(one, "spl_difference", "{:+.3f}".format, " to "),
            _with_interval(one, "improvement", _share),
            f"{one['first_wins']} : {one['second_wins']}",
            _chance(one["mcnemar_p_holm"]),
        ),
    )
    return table if rows else None


def shields(shielded: Sequence[Mapping[str, Any]], knows: Knows) -> Table | None:
    """How many steps the planner took over, and why, from a summary's shields; None without any."""
    table = empty_table(
        "Steps that the shield handed over to the planner",
        "policy",
        "steps",
        "handed\nover [%]",
        "untouched\nflights [%]",
        "why, most often",
    )
    _add(
        table,
        shielded,
        knows,
        lambda one: (
            one["policy"],
            str(one["steps"]),
            f"{100.0 * one['handed_over'] / one['steps']:.2f}",
            f"{100.0 * one['untouched_flights'] / one['flights']:.1f}",
            ", ".join(f"{cause} {number}" for cause, number in [*one["causes"].items()][:3])
            or NONE,
        ),
    )
    return table if shielded else None


def paper(rows: Sequence[Mapping[str, Any]], knows: Knows) -> Table | None:
    """A summary's flights through the paper's fields beside its Table I; None without any."""
    table = empty_table(
        "The paper's fields (reconstructed), with its Table I in brackets",
        "policy, field",
        "success",
        "segments",
        "func. eval.",
        "length [m]",
        "shortest",
        caption="medians over successful flights (-: no flight succeeded); (N/A): the paper found "
        "no path; no brackets: the paper does not report this policy on this field",
    )
    _add(table, rows, knows, _cells_of_paper)
    return table if rows else None


def _cells_of_paper(one: Mapping[str, Any]) -> tuple[str, ...]:
    policy, field = one["policy"], one["field"]
    row = TABLE_I.get((policy, field))
    cells = []
    for name, digits in (("segments", 0), ("evaluations", 0), ("length", 2)):
        printed = "" if row is None else decimal(getattr(row, name), digits, none="N/A")
        cells.append(decimal(one[name], digits) + (f" ({printed})" if printed else ""))
    counts = f"{one['successes']}/{one['flights']}"
    return (f"{policy} {field}", counts, *cells, decimal(one["exact_length"], 2))


def _add(
    table: Table,
    rows: Iterable[Mapping[str, Any]],
    knows: Knows,
    cells: Callable[[Mapping[str, Any]], tuple[str, ...]],
) -> None:
    """Add rows with a `policy`, in groups by what the policies know; the first cell is a name."""
    for heading, group in grouped(rows, lambda one: knows.get(one["policy"])):
        add_group(table, heading, map(cells, group))


def _number(number: int, what: str) -> str:
    return f"{number:,} {what}" if number == 1 else f"{number:,} {what}s"


def _turned(pair: Mapping[str, Any]) -> dict[str, Any]:
    """A pair with its policies exchanged."""
    turned = dict(pair)
    for one, other in (("first", "second"), ("first_wins", "second_wins")):
        turned[one], turned[other] = pair[other], pair[one]
    for key, whole in (("spl_difference", 0.0), ("improvement", 1.0)):
        turned[key] = whole - pair[key]
        for one, other in ((f"{key}_low", f"{key}_high"), (f"{key}_high", f"{key}_low")):
            turned[one] = None if pair[other] is None else whole - pair[other]
    return turned


def _with_interval(
    one: Mapping[str, Any], key: str, form: Callable[[float], str], until: str = _TO
) -> str:
    low, high = one[f"{key}_low"], one[f"{key}_high"]
    if low is None or high is None:
        return form(one[key])
    return f"{form(one[key])} ({form(low)}{until}{form(high)})"


def _gap(one: Mapping[str, Any], key: str) -> str:
    if one[key] is None:
        return _INFINITE if one["gap_flights"] else NONE
    return decimal(one[key], 2 if one[key] < 0.09995 else 1, 100.0)


def _share(share: float) -> str:
    return f"{100.0 * share:.1f}"


def _milliseconds(seconds: float | None) -> str:
    if seconds is None:
        return NONE
    digits = 2 if seconds < 1e-3 else 1 if seconds < 0.1 else 0
    return f"{1e3 * seconds:,.{digits}f}"


def _chance(p: float) -> str:
    return f"{p:.4f}" if p >= 1e-4 else "< 0.0001"
