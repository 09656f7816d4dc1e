"""report.html of an evaluation: one file with tables, profiles and flights, without a network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from agents.evaluation.flight_table import read
from agents.evaluation.report.flight_browser import BUDGET, browser
from agents.evaluation.statistics import caution, summary
from agents.evaluation.summary import timed
from ferguson_gym.runtime.arrays import LARGEST
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome

REPORT = "report.html"
_TEMPLATE = "template.html"
_PLACE = "/*DATA*/"
"""Where the template takes the data, once."""
_EQUAL = 5e-5
"""Smallest difference of SPL that shows in the printed digits."""
_CLOCK = "stopped_by_clock"
_LONG = 400
"""Characters of a value of the provenance that are shown."""


def write_report(
    directory: Path,
    fields: Mapping[str, Field] | None = None,
    statistics: Mapping[str, Any] | None = None,
    budget: int = BUDGET,
) -> None:
    """Write report.html beside flights.csv, timings.csv, paths.npz and summary.json.

    Of these, only flights.csv must be there. What summary.json says of how the results were made
    is shown, and times are taken from its `policies`, where they were measured when nothing else
    flew; timings.csv knows what they were while others did.

    Args:
        directory: results of an evaluation.
        fields: by name. Needed for those of files; others are redrawn by their name. What
            is neither is shown without obstacles.
        statistics: `agents.evaluation.statistics.summary` of the directory, if it is already there.
        budget: characters that flights may take; beyond, failures and large gaps are kept.

    Raises:
        ValueError: files that are not those of one evaluation.
    """
    flights = read(directory)
    found = summary(flights) if statistics is None else dict(statistics)
    held = _held(directory / "summary.json")
    told = _of_policies(held)
    found["policies"] = timed(found["policies"], told.values())
    lines = headline(found)
    if clocked := [name for name in flights.policies if told.get(name, {}).get(_CLOCK)]:
        lines["sentences"].append(
            f"Stopped by a clock, so that flights do not repeat exactly: {', '.join(clocked)}."
        )
    data = {
        "headline": lines,
        "statistics": found,
        "outcomes": {outcome.label: outcome.sentence for outcome in Outcome},
        "provenance": dict(_flat("", held)),
        "browser": browser(flights, directory, fields or {}, budget),
    }
    with atomic_write(directory / REPORT) as temporary:
        temporary.write_text(page(data), encoding="utf-8")


def page(data: Mapping[str, Any]) -> str:
    """The template with its data, in which nothing can end the element that holds it."""
    template = files("agents.evaluation.report").joinpath(_TEMPLATE).read_text(encoding="utf-8")
    before, after = template.split(_PLACE)
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)  # ASCII alone
    return before + text.replace("<", "\\u003c") + after


def headline(found: Mapping[str, Any]) -> dict[str, Any]:
    """A title and the sentences below it."""
    policies = found["policies"]
    title = (
        f"{_number(len(policies), 'policy', 'policies')} on "
        f"{_number(found['fields'], 'field', 'fields')}"
    )
    if not policies:
        return {"title": "No flights", "sentences": ["This evaluation holds no flights."]}
    arrived = sum(one["successes"] for one in policies)
    reached = f"{arrived:,} of {found['flights']:,} flights reached the goal"
    if len(policies) == 1:
        sentences = [f"{policies[0]['policy']} has an SPL of {_spl(policies[0])}."]
    else:
        best = max(policies, key=lambda one: float(one["spl"]))
        sentences = [f"{best['policy']} has the highest SPL, {_spl(best)}. {_lead(best, found)}"]
    if (warning := caution(found)) is not None:
        sentences.append(warning)
    if found["seeds"] > 1:
        reached += f", with {found['seeds']} policy seeds on each field"
    return {"title": title, "sentences": [*sentences, f"{reached}."]}


def _lead(best: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """Whom the best policy is ahead of beyond doubt, and by more than what is shown of an SPL."""
    name = best["policy"]
    equal, doubtful = [], []
    for pair in found["pairs"]:
        if name not in (pair["first"], pair["second"]):
            continue
        other = pair["second"] if pair["first"] == name else pair["first"]
        low, high = pair["spl_difference_low"], pair["spl_difference_high"]
        if low is None or high is None or low <= 0.0 <= high:
            doubtful.append(other)
        elif abs(pair["spl_difference"]) < _EQUAL:
            equal.append(other)
    told = []
    if equal:
        told.append(f"The lead over {', '.join(equal)} is below {_EQUAL:g}, of no importance.")
    if doubtful:
        told.append(
            f"These flights do not tell it from {', '.join(doubtful)} (paired 95 % interval)."
        )
    if len(equal) + len(doubtful) < len(found["policies"]) - 1:
        ahead = f"{name} is ahead of all others" if told else "It is ahead of every other policy"
        told.append(f"{ahead} (paired 95 % intervals).")
    return " ".join(told)


def _spl(one: Mapping[str, Any]) -> str:
    told = f"{one['spl']:.4f}"
    if one["spl_low"] is not None:
        told += f" ({one['spl_low']:.4f} to {one['spl_high']:.4f})"
    return told


def _number(count: int, one: str, many: str) -> str:
    return f"{count:,} {one if count == 1 else many}"


def _held(path: Path) -> dict[str, Any]:
    """What summary.json holds beside statistics; nothing if it is not there."""
    if not path.is_file():
        return {}
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {error}") from None
    if not isinstance(held, dict):
        raise ValueError(f"{path}: not a JSON object")
    return {key: value for key, value in held.items() if key not in ("statistics", "files")}


def _of_policies(held: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What it says of each policy, by name."""
    listed = held.get("policies")
    every = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    return {
        one["policy"]: {key: value for key, value in one.items() if not _is_no_time(key, value)}
        for one in every
        if isinstance(one.get("policy"), str)
    }


def _is_no_time(key: str, value: object) -> bool:
    """Whether something that should be a time, or none, is neither."""
    if "seconds" not in key or value is None:
        return False
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return True
    return not 0.0 <= value <= LARGEST


def _flat(prefix: str, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Texts by key; keys of what lies within others are joined by points."""
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
