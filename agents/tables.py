"""Tables for the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from agents.hands import Hand, share_handed_over
from agents.records import Record
from ferguson_gym.paper import TABLE_I
from planners.interface import Decision

_NONE = "-"


def console() -> Console:
    """Standard output; without a terminal, wide enough for every table."""
    standard = Console(highlight=False)
    return standard if standard.is_terminal else Console(highlight=False, width=120)


def empty_table(title: str, *columns: str, caption: str | None = None) -> Table:
    """A table without rows in the look of all; its first column holds words, the rest numbers."""
    table = Table(
        title=escape(title),
        caption=None if caption is None else escape(caption),
        title_justify="left",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=0,
    )
    for index, column in enumerate(columns):
        table.add_column(Text(column), justify="left" if index == 0 else "right", no_wrap=True)
    return table


def _median(values: Sequence[float | None], digits: int, scale: float = 1.0) -> str:
    known = [scale * value for value in values if value is not None]
    return f"{np.median(known):.{digits}f}" if known else _NONE


def summary(flights: Sequence[Record]) -> Table:
    """A row for each policy; length, gap and segments are medians over its successes."""
    table = empty_table(
        "Evaluation",
        "policy",
        "flights",
        "success",
        "SPL",
        "length [m]",
        "gap [%]",
        "segments",
        "step [ms]",
        "flight [s]",
        caption="SPL: mean of success x exact / max(length, exact); else medians; length, gap and "
        "segments over successful flights",
    )
    for policy in dict.fromkeys(flight.policy for flight in flights):
        flown = [flight for flight in flights if flight.policy == policy]
        arrived = [flight for flight in flown if flight.success]
        steps = np.concatenate([flight.decision_seconds for flight in flown])
        table.add_row(
            Text(policy),
            str(len(flown)),
            f"{100 * len(arrived) / len(flown):.1f} %",
            f"{np.mean([flight.path_share for flight in flown]):.4f}",
            _median([flight.length for flight in arrived], 2),
            _median([flight.gap for flight in arrived], 2, 100.0),
            _median([flight.segments for flight in arrived], 0),
            _median(steps.tolist(), 1, 1000.0),
            _median([flight.seconds for flight in flown], 2),
        )
    return table


def shields(flights: Sequence[Record]) -> Table | None:
    """How much of their flights shielded policies handed over, and why; None if none was."""
    table = empty_table(
        "Steps handed over by the shield",
        "policy",
        "steps",
        "handed over",
        "untouched flights",
        "why, most often",
    )
    for policy in dict.fromkeys(flight.policy for flight in flights if flight.hands):
        flown = [flight.hands for flight in flights if flight.policy == policy]
        hands = [hand for steps in flown for hand in steps]
        untouched = sum(share_handed_over(steps) == 0.0 for steps in flown)
        why = Counter(hand for hand in hands if hand is not Hand.AGENT)
        told = ", ".join(f"{hand.label} {number}" for hand, number in why.most_common(3))
        table.add_row(
            Text(policy),
            str(len(hands)),
            f"{100 * share_handed_over(hands):.2f} %",
            f"{100 * untouched / len(flown):.1f} %",
            told or _NONE,
        )
    return table if table.row_count else None


def paper_table(flights: Sequence[Record]) -> Table | None:
    """Flights through the paper's fields beside its Table I; None if there are none."""
    known = [flight for flight in flights if flight.from_paper]
    if not known:
        return None
    table = empty_table(
        "The paper's fields (reconstructed), in brackets its Table I",
        "planner, field",
        "flown",
        "segments",
        "func. eval.",
        "length [m]",
        "shortest",
        caption="medians over successes (-: none); N/A: the paper found no path",
    )
    pairs = dict.fromkeys((flight.policy, flight.field) for flight in known)
    for policy, name in pairs:
        flown = [f for f in known if (f.policy, f.field) == (policy, name)]
        arrived = [flight for flight in flown if flight.success]
        cells = [
            _median([f.segments for f in arrived], 0),
            _median([f.evaluations for f in arrived], 0),
            _median([f.length for f in arrived], 4),
        ]
        if (row := TABLE_I.get((policy, name))) is not None:
            theirs = [
                _printed(row.segments, 0),
                _printed(row.evaluations, 0),
                _printed(row.length, 4),
            ]
            cells = [f"{ours} ({paper})" for ours, paper in zip(cells, theirs, strict=True)]
        arrivals = f"{len(arrived)}/{len(flown)}"
        table.add_row(Text(f"{policy} {name}"), arrivals, *cells, f"{flown[0].exact_length:.4f}")
    return table


def _printed(value: float | None, digits: int) -> str:
    return "N/A" if value is None else f"{value:.{digits}f}"


def windows(decisions: Sequence[Decision]) -> Table:
    """How each window of a plan came about."""
    table = empty_table(
        "Windows",
        "step",
        "start kept",
        "feasible",
        "objective [m]",
        "eval.",
        "rounds",
        "ms",
        "solver",
        caption="final: re-optimised to end on the goal; the objective is then the length",
    )
    for decision in decisions:
        report = decision.report
        known = decision.chain is not None and report.starts > 0
        table.add_row(
            str(report.step),
            f"{report.start}, final" if report.final else report.start or "none",
            f"{report.feasible}/{report.starts}" if report.starts else _NONE,
            f"{report.objective:.4f}" if known else _NONE,
            str(report.evaluations),
            str(report.rounds) if known else _NONE,
            f"{1000 * report.seconds:.1f}",
            report.solver_status if known else _NONE,
        )
    return table
