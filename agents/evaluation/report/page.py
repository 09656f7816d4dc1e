"""report.html of an evaluation: tables, profiles and flights in one file that works offline."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from agents.evaluation.reading import read
from agents.evaluation.report.flight_browser import BUDGET, browser
from agents.evaluation.results import Paths, read_paths
from agents.evaluation.statistics import caution, summary
from agents.evaluation.summary import recorded_knowledge, timed
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.flights.flight_table import FlightTable
from agents.policies.knowledge import HEADINGS, LABELS, grouped
from ferguson_gym.runtime.arrays import LARGEST
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world import Field, Outcome

REPORT = "report.html"
_TEMPLATE = "template.html"
_PLACE = "/*DATA*/"
"""Place of the data in the template, where it occurs once."""
_EQUAL = 5e-5
"""Difference of SPL below which the shown digits are equal."""
_CLOCK = "stopped_by_clock"
_LONG = 400
"""Maximum number of characters of a provenance value."""


def write_report(
    directory: Path, fields: Mapping[str, Field] | None = None, budget: int = BUDGET
) -> None:
    """Write report.html again from flights.csv, timings.csv, paths.npz and summary.json.

    Only flights.csv must be there. From summary.json come the provenance and the times that were
    measured while nothing else flew; timings.csv has those of the evaluation itself.

    Args:
        directory: Results of an evaluation.
        fields: By name; needed for fields of files. A field that is neither there nor defined by
            its name is shown without obstacles.
        budget: Characters that flights may take; beyond, failures and large gaps are kept.

    Raises:
        ValueError: The files are damaged, or not of one evaluation.
    """
    flights = read(directory)
    place = directory / "paths.npz"
    paths = read_paths(place, len(flights)) if place.is_file() else None
    found = _read_summary(directory / "summary.json")
    found["statistics"] = summary(flights, knows=recorded_knowledge(found))
    write_page(directory / REPORT, flights, paths, found, fields or {}, budget)


def write_page(
    path: Path,
    flights: FlightTable,
    paths: Paths | None,
    summary: Mapping[str, Any],
    fields: Mapping[str, Field],
    budget: int = BUDGET,
) -> None:
    """Write the page of an evaluation; of the summary only `statistics` must be there.

    Other arguments are as in `write_report`.

    Raises:
        ValueError: The paths are damaged.
    """
    provenance = {key: summary[key] for key in summary if key not in ("statistics", "files")}
    policies = _of_policies(provenance)
    found = dict(summary["statistics"])
    found["policies"] = timed(found["policies"], policies.values())
    lines = headline(found)
    if clocked := [name for name in flights.policies if policies.get(name, {}).get(_CLOCK)]:
        lines["sentences"].append(
            "With a time limit, so their flights are not exactly reproducible: "
            f"{', '.join(clocked)}."
        )
    changes = _changes(provenance)
    if changes:
        lines["sentences"].append(f"Changes to all fields, also for shortest paths: {changes}.")
    data = {
        "headline": lines,
        "statistics": found,
        "knowledge": HEADINGS,
        "outcomes": {outcome.label: outcome.sentence for outcome in Outcome},
        "provenance": dict(_flat("", provenance)),
        "browser": browser(flights, paths, fields, budget, changes),
    }
    with atomic_write(path) as temporary:
        temporary.write_text(page(data), encoding="utf-8")


def page(data: Mapping[str, Any]) -> str:
    """The template with its data, escaped so that no text in it can end the script element."""
    template = files("agents.evaluation.report").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    before, after = template.split(_PLACE)
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)  # ASCII alone
    return before + text.replace("<", "\\u003c") + after


def headline(found: Mapping[str, Any]) -> dict[str, Any]:
    """The title, and the sentences below it."""
    policies = found["policies"]
    if not policies:
        return {"title": "No flights", "sentences": ["This evaluation contains no flights."]}
    number = _number(len(policies), "policy", "policies")
    title = f"{number} on {_number(found['fields'], 'field', 'fields')}"
    successes = sum(one["successes"] for one in policies)
    reached = f"{successes:,} of {found['flights']:,} flights reached the goal"
    if len(policies) == 1:
        sentences = [f"{policies[0]['policy']} has an SPL of {_spl(policies[0])}."]
    else:
        best = max(policies, key=lambda one: float(one["spl"]))
        sentences = [f"{_named(best)} has the highest SPL, {_spl(best)}. {_lead(best, found)}"]
        sentences += _best_of_others(best, policies)
    if (warning := caution(found)) is not None:
        sentences.append(warning)
    if found["seeds"] > 1:
        reached += f", with {found['seeds']} policy seeds on each field"
    return {"title": title, "sentences": [*sentences, f"{reached}."]}


def _named(one: Mapping[str, Any]) -> str:
    """A policy and what it knows, if that is known."""
    return f"{one['policy']} ({one['knows']})" if one["knows"] else str(one["policy"])


def _best_of_others(
    best: Mapping[str, Any], policies: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """A sentence on the best policy of each group that knows more or less than the best of all."""
    for heading, group in grouped(policies, lambda one: one["knows"]):
        if heading in LABELS and best["knows"] not in (heading, None):
            other = max(group, key=lambda one: float(one["spl"]))
            leader = f"{other['policy']} has the highest SPL, {_spl(other)}"
            yield f"Of the policies listed as {heading}, {leader}."


def _lead(best: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """Which policies the best one leads beyond doubt, and by more than an SPL's shown digits."""
    name = best["policy"]
    equal, inconclusive = [], []
    for pair in found["pairs"]:
        if name not in (pair["first"], pair["second"]):
            continue
        other = pair["second"] if pair["first"] == name else pair["first"]
        low, high = pair["spl_difference_low"], pair["spl_difference_high"]
        if low is None or high is None or low <= 0.0 <= high:
            inconclusive.append(other)
        elif abs(pair["spl_difference"]) < _EQUAL:
            equal.append(other)
    sentences = []
    if equal:
        sentences.append(f"Its lead over {', '.join(equal)} is negligible, below {_EQUAL:g}.")
    if inconclusive:
        sentences.append(
            f"The difference from {', '.join(inconclusive)} is not significant (paired 95 % "
            "interval)."
        )
    if len(equal) + len(inconclusive) < len(found["policies"]) - 1:
        subject, others = (name, "all others") if sentences else ("It", "every other policy")
        sentences.append(
            f"{subject} is significantly better than {others} (paired 95 % intervals)."
        )
    return " ".join(sentences)


def _spl(one: Mapping[str, Any]) -> str:
    text = f"{one['spl']:.4f}"
    if one["spl_low"] is not None:
        text += f" ({one['spl_low']:.4f} to {one['spl_high']:.4f})"
    return text


def _number(count: int, one: str, many: str) -> str:
    return f"{count:,} {one if count == 1 else many}"


def _read_summary(path: Path) -> dict[str, Any]:
    """The object of summary.json; empty if there is no such file."""
    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {error}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{path}: not a JSON object")
    return found


def _changes(summary: Mapping[str, Any]) -> FieldChanges:
    """How fields were changed; not at all if the summary does not say so."""
    configuration = summary.get("configuration")
    try:
        return FieldChanges.of_json(configuration if isinstance(configuration, dict) else {})
    except ValueError:  # malformed
        return UNCHANGED


def _of_policies(summary: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Entries of summary.json by policy, without malformed ones."""
    listed = summary.get("policies")
    every = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    return {
        one["policy"]: {
            key: value for key, value in one.items() if not _is_malformed_time(key, value)
        }
        for one in every
        if isinstance(one.get("policy"), str)
    }


def _is_malformed_time(key: str, value: object) -> bool:
    """Whether the value of a time is neither a time nor None."""
    if "seconds" not in key or value is None:
        return False
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return True
    return not 0.0 <= value <= LARGEST


def _flat(prefix: str, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Keys and texts of nested values; the keys of a nested value are joined by points."""
    rows: list[tuple[str, str]] = []
    for key, value in values.items():
        inside = value
        if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
            inside = {str(one.get("policy", k)): one for k, one in enumerate(value)}
        if isinstance(inside, dict):
            rows += _flat(f"{prefix}{key}.", inside)
        else:
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            whole = len(text) <= _LONG or key == "command"
            rows.append((prefix + key, text if whole else f"{text[:_LONG]} …"))
    return rows
