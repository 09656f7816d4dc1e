"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Literal

from rich import box
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from planners import Decision

NONE = "-"
"""Text of a cell without a value."""


def empty_table(
    title: str, *columns: str, caption: str | None = None, broken: Collection[str] = ()
) -> Table:
    """A table without rows, in the common style: words in the first column, numbers in the others.

    In a narrow terminal the words are folded, and cells of columns in `broken` continue in a second
    line after a space; other numbers are not folded.
    """
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
        justify: Literal["left", "right"] = "left" if index == 0 else "right"
        table.add_column(
            Text(column),
            justify=justify,
            no_wrap=index > 0 and column not in broken,
            overflow="fold",
            vertical="top",
        )
    return table


def add_group(table: Table, heading: str, rows: Iterable[Sequence[str]]) -> None:
    """Add rows of plain text below a heading, with space behind them."""
    table.add_row(Text(f"{heading}:", style="italic"))
    for cells in rows:
        table.add_row(*map(Text, cells))
    table.add_section()


def decimal(value: float | None, digits: int, scale: float = 1.0, none: str = NONE) -> str:
    """`scale * value` with `digits` decimals; a value that rounds to zero has no sign."""
    return none if value is None else f"{round(scale * value, digits) + 0.0:.{digits}f}"


def windows(decisions: Sequence[Decision]) -> Table:
    """Table of the windows of a plan, one row a decision."""
    table = empty_table(
        "Windows",
        *("step", "start kept", "feasible", "objective [m]", "eval.", "rounds", "ms", "solver"),
        caption="final: re-optimised to end on the goal; the objective is then the length",
    )
    for decision in decisions:
        report = decision.report
        known = decision.chain is not None and report.starts > 0
        table.add_row(
            str(report.step),
            f"{report.start}, final" if report.final else report.start or "none",
            f"{report.feasible}/{report.starts}" if report.starts else NONE,
            f"{report.objective:.4f}" if known else NONE,
            str(report.evaluations),
            str(report.rounds) if known else NONE,
            f"{1000 * report.seconds:.1f}",
            report.solver_status if known else NONE,
        )
    return table
