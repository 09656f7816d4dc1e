"""Flying demonstrations in parallel, chunk by chunk, so that an interruption loses little.

A chunk is a file in a work directory, written whole when its fields are flown. Whoever flies which
chunk, and however often the work is interrupted, the chunks are the same in the end.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from joblib import delayed

import ferguson_gym
from agents.demonstrations.episode import Episode, make_environment, pack, record, unpack
from agents.policies.interface import Policy
from agents.policies.registry import make_policy
from agents.runtime.executors import map_in_processes
from agents.runtime.interrupts import raise_if_interrupted
from agents.runtime.kernels import compile_kernels
from agents.runtime.provenance import commit, facts
from agents.runtime.safe_npz import read_arrays
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field_names import family

CHUNK = 10
"""Fields in a file; those of unfinished files are flown again after an interruption."""
MOST = 1_000_000
"""Fields of one data set."""
LIBRARIES = ("ferguson-gym", "gymnasium", "numpy", "scipy", "numba", "daqp")
"""What flights depend on."""
_REQUEST = "request.json"


def _software() -> dict[str, Any]:
    return {"versions": facts(*LIBRARIES)["versions"], "commit": commit()}


@dataclass(frozen=True, kw_only=True)
class Request:
    """Which demonstrations are wanted: they are a function of it.

    Raises:
        ValueError: a specification of fields that is unknown, names files, or names a field for
            the second time; too many fields.
    """

    expert: str
    """The name of a policy, with its options."""
    specs: tuple[str, ...]
    """Of the fields, as the catalog understands them."""
    arguments: Mapping[str, Any]
    """Of the environment."""
    software: Mapping[str, Any] = field(default_factory=_software)
    """Versions and commit, which may change the expert's flights."""

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
        """Arguments of the environment: the fields' suite and split, where they have one."""
        families = {name.partition(":")[0] for name in self.fields}
        suite, _, split = families.pop().partition("/")
        own = {"suite": suite, "split": split} if not families and split else {}
        return own | dict(self.arguments)

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-len(self.fields) // CHUNK)

    def chunk(self, number: int) -> list[str]:
        """The fields of a chunk."""
        return self.fields[number * CHUNK : (number + 1) * CHUNK]

    @cached_property
    def digest(self) -> str:
        """Short, and different for any other request."""
        text = json.dumps(self.as_json(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def as_json(self) -> dict[str, Any]:
        """What makes it this request, as values that JSON has."""
        return {
            "expert": self.expert,
            "fields": list(self.specs),
            "environment": {"id": ferguson_gym.ENVIRONMENT_ID, "arguments": self.environment},
            **self.software,
        }


def check(place: Path, request: Request) -> None:
    """Refuse to go on with the work of another request.

    Raises:
        ValueError: the work directory holds another request's work, or something else.
    """
    # a run may have been stopped before it wrote what it is
    if not any(not path.name.startswith(".") for path in place.glob("*")):
        return
    wanted = request.as_json()
    try:
        found = json.loads((place / _REQUEST).read_text(encoding="utf-8"))
        differing = [key for key in wanted if found.get(key) != wanted[key]]
    except (OSError, ValueError, AttributeError):
        raise ValueError(
            f"{place} holds no work on demonstrations; start over with --fresh"
        ) from None
    if differing:
        changes = "; ".join(
            f"{key} was {json.dumps(found.get(key))}, now {json.dumps(wanted[key])}"
            for key in differing
        )
        raise ValueError(
            f"an interrupted run of other demonstrations lies at {place} ({changes}); finish it "
            "with its own command, or start over with --fresh"
        )


def begin(place: Path, request: Request) -> list[int]:
    """Make or take up a work directory.

    Returns:
        The chunks that are missing.

    Raises:
        ValueError: as `check`.
    """
    check(place, request)
    place.mkdir(parents=True, exist_ok=True)
    if not (place / _REQUEST).exists():
        with atomic_write(place / _REQUEST) as temporary:
            temporary.write_text(json.dumps(request.as_json(), indent=1), encoding="utf-8")
    return [k for k in range(request.chunks) if not _file(place, request, k).exists()]


def _file(place: Path, request: Request, number: int) -> Path:
    # the digest: a worker that outlived a killed run must not write into another request's work
    return place / f"chunk-{request.digest}-{number:06d}.npz"


def fly(place: Path, request: Request, missing: Iterable[int], workers: int) -> Iterator[int]:
    """Fly the missing chunks; yields the number of fields of each that is done.

    Raises:
        WorkerDiedError: a worker died; what is finished is kept.
    """
    arguments = json.dumps(request.environment, sort_keys=True)
    tasks = (
        (request.expert, arguments, request.chunk(number), _file(place, request, number))
        for number in missing
    )
    calls = (delayed(_fly_chunk)(*task) for task in tasks)
    with map_in_processes(calls, workers) as done:
        yield from done


def flown(place: Path, request: Request) -> Iterator[Episode]:
    """The episodes of all fields in order, when no chunk is missing; failed ones, too.

    Raises:
        OSError: a chunk cannot be read.
    """
    for number in range(request.chunks):
        path = _file(place, request, number)
        try:
            episodes = list(unpack(read_arrays(path)))
        except ValueError as error:
            raise OSError(f"{path} is damaged ({error}): remove it, and run again") from None
        yield from episodes


def _fly_chunk(
    expert: str,
    arguments: str,
    fields: list[str],
    path: Path,
) -> int:
    """Fly some fields and write their chunk: what a worker process is handed."""
    if path.exists():
        return len(fields)
    compile_kernels()
    policy, env = _policy(expert), _environment(arguments)
    episodes = []
    for name in fields:
        try:
            episodes.append(record(env, name, policy))
        except Exception as error:
            error.add_note(f"while {expert} flew the field {name}")
            raise
        raise_if_interrupted()
    with atomic_write(path) as temporary:
        np.savez(temporary, allow_pickle=False, **pack(episodes))
    return len(fields)


@cache
def _policy(name: str) -> Policy:
    """One for all of a process: it flies one field after the other."""
    return make_policy(name)


@cache
def _environment(arguments: str) -> gym.Env[Observation, Action]:
    return make_environment(json.loads(arguments))
