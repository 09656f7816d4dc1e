"""Flying demonstrations in parallel and in chunks, so that an interruption loses little work."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import gymnasium as gym
from joblib import delayed

import ferguson_gym
from agents.demonstrations.episode import Episode, make_environment, pack, record, unpack
from agents.policies import Policy, make_policy
from agents.runtime.chunk_store import ChunkStore
from agents.runtime.interrupts import raise_if_interrupted
from agents.runtime.provenance import commit, facts
from agents.runtime.worker_processes import map_in_processes
from ferguson_gym.simulation import Observation, arguments_to_save
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field_names import family

CHUNK = 10
"""Fields in a chunk; an unfinished chunk is flown again after an interruption."""
MOST = 1_000_000
"""Limit of fields in a dataset."""
LIBRARIES = ("ferguson-gym", "gymnasium", "numpy", "scipy", "numba")
"""Libraries that flights depend on."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Everything that determines demonstrations.

    Raises:
        ValueError: a specification of fields that is unknown, names files, or repeats a field; too
            many fields.
    """

    expert: str
    """Name of a planner, with its options."""
    specs: tuple[str, ...]
    """Fields by name, see `ferguson_gym.world.field_names`."""
    arguments: Mapping[str, Any]
    """Arguments of the environment."""
    software: Mapping[str, Any] = field(
        default_factory=lambda: {"versions": facts(*LIBRARIES)["versions"], "commit": commit()}
    )
    """Versions of libraries and commit, which the expert's flights may depend on."""

    def __post_init__(self) -> None:
        families = [family(spec) for spec in self.specs]
        if (number := sum(len(numbers) for _, numbers in families)) > MOST:
            raise ValueError(f"demonstrations are of at most {MOST} fields, not {number}")
        if len(set(self.fields)) < number:
            raise ValueError(f"fields {', '.join(self.specs)} name a field twice")

    @cached_property
    def fields(self) -> list[str]:
        """Names of the fields, in order."""
        families = [family(spec) for spec in self.specs]
        return [f"{name}:{number}" for name, numbers in families for number in numbers]

    @cached_property
    def environment(self) -> dict[str, Any]:
        """Arguments of the environment, with the fields' suite and split if they share one."""
        families = {name.partition(":")[0] for name in self.fields}
        suite, _, split = families.pop().partition("/")
        own = {"suite": suite, "split": split} if not families and split else {}
        return own | arguments_to_save(self.arguments)

    def chunk(self, number: int) -> list[str]:
        """Names of the fields of a chunk."""
        return self.fields[number * CHUNK : (number + 1) * CHUNK]

    def as_json(self) -> dict[str, Any]:
        """What identifies the request, as JSON values."""
        return {
            "expert": self.expert,
            "fields": list(self.specs),
            "environment": {"id": ferguson_gym.ENVIRONMENT_ID, "arguments": self.environment},
            **self.software,
        }


def open_store(place: Path, request: Request) -> ChunkStore:
    """The chunk store of a request in a work directory."""
    return ChunkStore(
        place=place, request=request.as_json(), number=-(-len(request.fields) // CHUNK)
    )


def fly(store: ChunkStore, request: Request, missing: Iterable[int], workers: int) -> Iterator[int]:
    """Fly the missing chunks.

    Yields:
        The number of fields of each finished chunk.

    Raises:
        WorkerDiedError: workers died repeatedly at the same chunk; finished chunks are kept.
    """
    arguments = json.dumps(request.environment, sort_keys=True)
    calls = (
        delayed(_fly_chunk)(request.expert, arguments, request.chunk(number), store, number)
        for number in missing
    )
    with map_in_processes(calls, workers) as done:
        yield from done


def flown(store: ChunkStore) -> Iterator[Episode]:
    """The episodes of all fields in order, failed ones included; no chunk may be missing.

    Raises:
        OSError: a chunk cannot be read.
    """
    for number in range(store.number):
        yield from store.read(number, lambda packed: list(unpack(packed)))


def _fly_chunk(
    expert: str, arguments: str, fields: list[str], store: ChunkStore, number: int
) -> int:
    """Fly some fields and write their chunk, in a worker process."""
    if store.file(number).exists():
        return len(fields)
    policy, env = _policy(expert), _environment(arguments)
    episodes = []
    for name in fields:
        try:
            episodes.append(record(env, name, policy))
        except Exception as error:
            error.add_note(f"while {expert} flew the field {name}")
            raise
        raise_if_interrupted()
    store.write(number, pack(episodes))
    return len(fields)


@cache
def _policy(name: str) -> Policy:
    return make_policy(name)


@cache
def _environment(arguments: str) -> gym.Env[Observation, Action]:
    return make_environment(json.loads(arguments))
