"""What policies know of a field: by their names, and tables divided by it.

A planner or a policy states what it knows (`planners.interface.knowledge_of`). Results keep it as
the label of a `planners.interface.Knowledge`, None where nothing is known of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

from agents.models import shipped_agents
from agents.policies.registry import make_policy
from agents.policies.spec import PolicySpec
from planners.interface import Knowledge, knowledge_of

LABELS = tuple(knowledge.label for knowledge in Knowledge)
"""Labels in the order in which tables show their groups."""
UNKNOWN = "?"
"""Heading of the last group, of policies of which nothing says what they know."""
HEADINGS = {knowledge.label: knowledge.sentence for knowledge in Knowledge}
HEADINGS |= {UNKNOWN: "does not say what it knows"}
"""All headings in order, with what a policy below them knows."""
LEGEND = "; ".join(f"{label}: {HEADINGS[label]}" for label in LABELS)
"""A sentence below tables, on their headings."""
Knows = Mapping[str, str | None]
"""Labels by the names of policies; None where nothing says what a policy knows."""
Row = TypeVar("Row")


def labels(policies: Iterable[str], recorded: Mapping[str, object]) -> dict[str, str | None]:
    """What policies know: as recorded, or by their names where nothing valid is recorded."""
    stated = {name: recorded.get(name) for name in policies}
    return {
        name: label if isinstance(label, str) and label in LABELS else label_by_name(name)
        for name, label in stated.items()
    }


def label_by_name(name: str) -> str | None:
    """What the policy of this name knows of a field, for results that do not record it.

    None for trained agents, whose paths may hold others by now, and for policies that cannot be
    made here.
    """
    try:
        if set(PolicySpec.parse(name).agents) <= set(shipped_agents.shipped()):
            return knowledge_of(make_policy(name)).label
    except Exception:  # whatever the planner of another package raises
        pass
    return None


def grouped(rows: Iterable[Row], label: Callable[[Row], str | None]) -> list[tuple[str, list[Row]]]:
    """Rows by what their policies know: headings, and the rows below each in their order."""
    groups: dict[str, list[Row]] = {heading: [] for heading in HEADINGS}
    for row in rows:
        groups[label(row) or UNKNOWN].append(row)
    return [(heading, found) for heading, found in groups.items() if found]
