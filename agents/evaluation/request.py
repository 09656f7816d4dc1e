"""The request of an evaluation, and how its flights are divided into chunks.

Flights are in the order of flights.csv: by policy, then by field, then by seed. A chunk is a range
of consecutive flights of one policy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import Any

from agents.evaluation import provenance
from agents.flights.field_changes import UNCHANGED, FieldChanges
from agents.policies import PolicySpec
from ferguson_gym.world import Field, get_field

PLANNED, BATCHED = 10, 256
"""Flights in a chunk of a planner, and of an agent that flies in batches. After an interruption
the flights of unfinished chunks are flown again."""
Source = str | Field
"""A field, or the name of a field that every worker can draw: `standard/test:7`."""


def name_of(source: Source) -> str:
    """The field's name."""
    return source if isinstance(source, str) else source.name


def field_of(source: Source, changes: FieldChanges = UNCHANGED) -> Field:
    """The field itself, changed."""
    field = get_field(source) if isinstance(source, str) else source
    return changes.apply(field)


def is_batched(policy: str) -> bool:
    """Whether a policy is an agent alone, which flies many fields at once."""
    spec = PolicySpec.parse(policy)
    return not (spec.shield or spec.is_planner or spec.tries or spec.sensing)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Flights `first` to `last - 1` of a policy."""

    number: int
    policy: str
    first: int
    last: int

    def __len__(self) -> int:
        return self.last - self.first


@dataclass(frozen=True, kw_only=True)
class Request:
    """Which flights to fly; except for times, the results are a function of it.

    Raises:
        ValueError: There are no policies, fields or seeds.
    """

    policies: Sequence[str]
    fields: Sequence[Source]
    seeds: Sequence[int]
    """Policy seeds."""
    changes: FieldChanges = UNCHANGED
    """Of all fields."""
    chunk: int | None = None
    """Flights in a chunk; None: `BATCHED` or `PLANNED`. No flight depends on it."""
    software: Mapping[str, Any] = field(default_factory=provenance.software)
    """Versions and commit, which may change flights."""

    def __post_init__(self) -> None:
        for what in ("policies", "fields", "seeds"):
            if not getattr(self, what):
                raise ValueError(f"nothing to fly: no {what}")

    @property
    def flights(self) -> int:
        """Number of flights."""
        return len(self.policies) * self.each

    @property
    def each(self) -> int:
        """Number of flights of each policy."""
        return len(self.fields) * len(self.seeds)

    def field(self, source: Source) -> Field:
        """A field as it is flown."""
        return field_of(source, self.changes)

    def flight(self, index: int) -> tuple[Source, int]:
        """Field and seed of a flight, by its index among the flights of a policy."""
        place, turn = divmod(index, len(self.seeds))
        return self.fields[place], self.seeds[turn]

    @cached_property
    def chunks(self) -> list[Chunk]:
        """All chunks, in order."""
        parts: list[Chunk] = []
        for policy in self.policies:
            size = self.chunk or (BATCHED if is_batched(policy) else PLANNED)
            for first in range(0, self.each, size):
                last = min(first + size, self.each)
                parts.append(Chunk(number=len(parts), policy=policy, first=first, last=last))
        return parts

    @cached_property
    def configuration(self) -> dict[str, Any]:
        """Everything that distinguishes this request from others, as JSON values."""
        given = [source for source in self.fields if isinstance(source, Field)]
        return {
            "policies": {policy: provenance.models(policy) for policy in self.policies},
            "fields": spans([name_of(source) for source in self.fields]),
            "files": {one.name: provenance.hash_field(one) for one in given},
            **self.changes.as_json(),
            "seeds": spans([f":{seed}" for seed in self.seeds]),
            "chunk": self.chunk or [PLANNED, BATCHED],
            **self.software,
        }


def spans(names: Sequence[str]) -> list[str]:
    """Names in order, with consecutive numbers as ranges: `paper:1-4`, and `:0-9` as `0-9`."""
    found: list[str] = []
    numbered = [(*name.rpartition(":")[::2], place) for place, name in enumerate(names)]
    for _, group in groupby(numbered, lambda one: _run(*one)):
        run = list(group)
        family, first, _ = run[0]
        last = run[-1][1]
        numbers = first if len(run) == 1 else f"{first}-{last}"
        found.append(f"{family}:{numbers}" if family else numbers)
    return found


def _run(family: str, number: str, place: int) -> tuple[str, int | str]:
    # the difference between number and place is constant along a range
    counts = number.isdecimal() and str(int(number)) == number
    return family, int(number) - place if counts else f"{number} {place}"
