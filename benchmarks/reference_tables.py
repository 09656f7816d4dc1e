"""The reference tables as Markdown: evaluations of all policies on whole suites.

Run it from a checkout, on directories of results; those of the same fields' family share a table,
and a policy that several of them have gets the row of the last one by name:

    .venv/bin/python benchmarks/reference_tables.py keep results/reference/* --times results/times
    .venv/bin/python benchmarks/reference_tables.py show

`keep` writes what the tables need of each summary.json into docs/results/, `show` prints the
tables made of that, which docs/results.md holds.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.policies.knowledge import grouped, labels
from ferguson_gym.runtime.atomic_files import atomic_write

KEPT = Path(__file__).parent.parent / "docs" / "results"
"""A JSON file for each evaluation."""
FLOWN = (
    "policy",
    "fields",
    "flights",
    "successes",
    "outcomes",
    "success",
    "success_low",
    "success_high",
    "spl",
    "spl_low",
    "spl_high",
    "gap_median",
    "gap_99",
)
"""Of a policy's statistics, what the tables need."""
TIMED = ("decision_seconds_median", "decision_seconds_99", "flight_seconds_median")
COLUMNS = (
    "policy",
    "fields",
    "success (95 %)",
    "SPL (95 %)",
    "gap, median",
    "gap, 99 %",
    "flight, median",
)


def kept(directory: Path) -> dict[str, Any]:
    """The entries of a directory's summary that the tables need.

    Raises:
        ValueError: there are none, or they are of several families of fields.
    """
    try:
        summary = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
        fields = summary["configuration"]["fields"]
        rows = summary["statistics"]["policies"]
    except (OSError, ValueError, KeyError):
        raise ValueError(f"no results of an evaluation in {directory}") from None
    families = {name.rpartition(":")[0] for name in fields}
    if len(families) != 1:
        raise ValueError(f"{directory} has fields of {', '.join(sorted(families))}; need one suite")
    return {
        "family": families.pop(),
        "fields": fields,
        "command": re.sub(
            r"--out \S+", f"--out results/reference/{directory.name}", summary["command"]
        ),
        "commit": summary["configuration"]["commit"],
        "versions": summary["configuration"]["versions"],
        "policies": [
            {key: row[key] for key in FLOWN} | {"knows": row.get("knows")} for row in rows
        ],
    }


def times(directory: Path) -> dict[str, Any]:
    """Times by policy, from an evaluation on a quiet machine."""
    summary = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    return {
        "command": summary["command"],
        "machine": summary["machine"],
        "policies": {
            row["policy"]: {key: row[key] for key in TIMED} for row in summary["policies"]
        },
    }


def tables(evaluations: Iterable[Mapping[str, Any]], timed: Mapping[str, Any]) -> str:
    """Markdown: for each family a heading, its table, and the commands that make it."""
    families: dict[str, list[Mapping[str, Any]]] = {}
    for one in evaluations:
        families.setdefault(one["family"], []).append(one)
    parts = []
    for family, ones in families.items():
        # a policy that was flown again counts as it was flown last
        rows = list({row["policy"]: row for one in ones for row in one["policies"]}.values())
        commands = "\n".join(_folded(one["command"]) for one in ones)
        parts.append(
            f"## {family}\n\n{_table(rows, timed['policies'])}\n\n```sh\n{commands}\n```\n"
        )
    return "\n".join(parts)


def _table(rows: Sequence[Mapping[str, Any]], timed: Mapping[str, Any]) -> str:
    lines = [f"| {' | '.join(COLUMNS)} |", f"| --- |{' ---: |' * (len(COLUMNS) - 1)}"]
    # excerpts of older evaluations do not record what policies know
    recorded = {row["policy"]: row.get("knows") for row in rows}
    knows = labels(recorded, recorded)
    ranked = sorted(rows, key=lambda row: -float(row["spl"]))
    for heading, group in grouped(ranked, lambda row: knows[row["policy"]]):
        lines.append(f"| **{heading}** |{' |' * (len(COLUMNS) - 1)}")
        lines += [f"| {' | '.join(_cells(row, timed))} |" for row in group]
    return "\n".join(lines)


def _cells(row: Mapping[str, Any], timed: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        f"`{row['policy']}`",
        f"{row['fields']:,}",
        f"{_percent(row['success'])} % ({_percent(row['success_low'])} to "
        f"{_percent(row['success_high'])})",
        f"{row['spl']:.3f} ({row['spl_low']:.3f} to {row['spl_high']:.3f})",
        _gap(row["gap_median"]),
        _gap(row["gap_99"]),
        _milliseconds(timed.get(row["policy"], {}).get("flight_seconds_median")),
    )


def _percent(share: float) -> str:
    text = f"{100.0 * share:.1f}"
    return "100" if text == "100.0" and share == 1.0 else "99.9+" if text == "100.0" else text


def _gap(gap: float | None) -> str:
    if gap is None:
        return "failed"
    percent = 100.0 * gap
    return f"{percent:.2f} %" if percent < 9.995 else f"{percent:.1f} %"


def _milliseconds(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.1f} s"


def _folded(command: str) -> str:
    """A command in lines that a page shows whole."""
    lines = [""]
    for word in f".venv/bin/{command}".replace(" --", "\n--").split("\n"):
        if len(lines[-1]) + len(word) > 90:
            lines.append("    ")
        lines[-1] += (" " if lines[-1].strip() else "") + word
    return " \\\n".join(lines)


def main() -> None:
    """Keep the entries of evaluations that the tables need, or show the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    commands = parser.add_subparsers(dest="command", required=True)
    keep = commands.add_parser("keep", help="what the tables need of these results")
    keep.add_argument("results", type=Path, nargs="+", metavar="DIR")
    keep.add_argument("--times", type=Path, metavar="DIR", help="of all policies, in one run")
    commands.add_parser("show", help="the tables of what is kept")
    given = parser.parse_args()
    if given.command == "show":
        print(shown(), end="")
        return
    try:
        found = {one.name: kept(one) for one in given.results}
        if given.times:
            found["times"] = times(given.times)
    except ValueError as error:
        parser.error(str(error))
    KEPT.mkdir(exist_ok=True)
    for name, one in found.items():
        with atomic_write(KEPT / f"{name}.json") as temporary:
            temporary.write_text(json.dumps(one, indent=1, allow_nan=False) + "\n", "utf-8")


def shown() -> str:
    """The tables of what is kept."""
    files = {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(KEPT.glob("*.json"))}
    timed = files.pop("times")
    order = ("standard", "dense", "forest", "traps", "town", "walls")
    names = sorted(files, key=lambda name: (order.index(name.partition("-")[0]), name))
    return tables([files[name] for name in names], timed)


if __name__ == "__main__":
    main()
