"""Hyperparameters from YAML as the RL Zoo reads and writes it, checked before they are used.

Below the environment's id are `n_envs`, `n_timesteps`, `policy`, `policy_kwargs`, `env_kwargs`,
and the algorithm's own arguments; below `ferguson`, or in the same block, what the Zoo does not
know, such as `eval_freq`. Values are plain YAML; `lin_X` is a number that decreases linearly from X
to 0 over the training. `agents.training.zoo_files` translates what the Zoo writes in another way.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.runtime.safe_npz import reason
from agents.training import zoo_files

SHIPPED = Path(__file__).parent / "configs"
"""Directory of the shipped files; `ALGORITHM.yml` is the default of each algorithm."""
_COMMON = ("n_envs", "n_timesteps", "eval_freq", "policy", "policy_kwargs", "env_kwargs")
_FIELDS = ("fields", "choose_on")
"""Keys that name fields."""
_LINEAR = "lin_"
_EVALUATIONS = 50
"""Number of evaluations where a file has no `eval_freq`, as those of the RL Zoo."""
_LARGEST = 100_000
"""Limit on the size of a file [bytes]."""
_MOST_ALIASES = 10
"""Limit on the aliases (`*name`) in a file: nested ones expand to exponentially many values."""
_DEEPEST = 50
"""Limit on nesting: the time to read a bracket grows with the number of those open."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hyperparameters:
    """Hyperparameters of a training."""

    n_envs: int
    """Environments that are stepped together."""
    n_timesteps: int
    """Total number of segments flown, if no other limit is given."""
    eval_freq: int
    """Segments between two evaluations."""
    policy: str
    """Name in `agents.models.networks.POLICIES`."""
    policy_kwargs: dict[str, Any]
    env_kwargs: dict[str, Any]
    """Arguments of the environment."""
    learner: dict[str, Any]
    """The algorithm's own arguments: numbers, words, or `lin_X`."""
    fields: tuple[str, ...] = ()
    """Names of the fields to train on; empty: those of the environment."""
    choose_on: tuple[str, ...] = ()
    """Names of the fields on which the best model is chosen; empty: those of the run."""


def read(given: str, known: Collection[str]) -> Hyperparameters:
    """Read hyperparameters from a file, or shipped ones by their name.

    Args:
        given: path of a YAML file, or a name in `agents/training/configs`, for example ppo.
        known: the algorithm's own keys; others are refused.

    Raises:
        ValueError: no such file, not YAML, unknown or missing keys, or values of a wrong type.

    Warns:
        UserWarning: keys of the RL Zoo that are ignored.
    """
    import yaml

    shipped = SHIPPED / f"{given}.yml"
    path = shipped if shipped.is_file() else Path(given)
    try:
        text = path.read_bytes()
    except (OSError, ValueError):  # no such file, or not a valid name
        names = ", ".join(sorted(file.stem for file in SHIPPED.glob("*.yml")))
        raise ValueError(f"no hyperparameters at {given}: need a YAML file, or {names}") from None
    try:
        if len(text) > _LARGEST:
            raise ValueError(f"more than {_LARGEST:,} bytes")
        aliases = depth = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            aliases += isinstance(event, yaml.AliasEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if aliases > _MOST_ALIASES:
                raise ValueError(f"more than {_MOST_ALIASES} aliases")
            if depth > _DEEPEST:
                raise ValueError(f"nested more than {_DEEPEST} deep")
        content = yaml.safe_load(text)
    except Exception as error:  # the library raises errors of many types on a damaged file
        raise ValueError(f"{given}: not YAML ({reason(error)})") from None
    try:
        entries = zoo_files.entries(content)
    except ValueError as error:
        raise ValueError(f"{given}: {error}") from None
    if unknown := sorted(set(entries) - {*_COMMON, *_FIELDS, *known}):
        raise ValueError(
            f"{given}: unknown keys {', '.join(map(repr, unknown))}; known are "
            f"{', '.join([*_COMMON, *_FIELDS, *sorted(known)])}"
        )
    if missing := [key for key in ("n_timesteps", "policy") if key not in entries]:
        raise ValueError(f"{given}: missing keys {', '.join(missing)}")
    try:
        steps = _count(entries, "n_timesteps")
        return Hyperparameters(
            n_envs=_count(entries, "n_envs"),
            n_timesteps=steps,
            eval_freq=_count({"eval_freq": max(steps // _EVALUATIONS, 1)} | entries, "eval_freq"),
            policy=str(entries["policy"]),
            policy_kwargs=_mapping("policy_kwargs", entries.get("policy_kwargs")),
            env_kwargs=_mapping("env_kwargs", entries.get("env_kwargs")),
            learner={key: _plain(key, entries[key]) for key in entries if key in known},
            **{key: _names(key, entries.get(key, [])) for key in _FIELDS},
        )
    except (ValueError, RecursionError) as error:  # a list may contain itself
        raise ValueError(f"{given}: {error}") from None


def slope(value: object) -> float | None:
    """The X of `lin_X`; None for any other value.

    Raises:
        ValueError: X is not a number.
    """
    if not isinstance(value, str) or not value.startswith(_LINEAR):
        return None
    number = _number(value.removeprefix(_LINEAR))
    if number is None:
        raise ValueError(f"need a number after {_LINEAR}, got {value!r}")
    return number


def _count(entries: dict[str, Any], key: str) -> int:
    number = _number(value := entries[key])
    if number is None or number < 1 or number != int(number):
        raise ValueError(f"{key} must be an integer >= 1, got {value!r}")
    return int(number)


def _names(key: str, value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise ValueError(f"{key} must be a list of names, got {value!r}")
    return tuple(value)


def _mapping(key: str, value: object) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
        raise ValueError(f"{key} must have keys and values, got {value!r}")
    return {name: _plain(f"{key}.{name}", entry) for name, entry in value.items()}


def _plain(key: str, value: object) -> Any:
    """A JSON value; `1e-3`, which YAML 1.1 reads as a word, becomes a number."""
    if isinstance(value, list):
        return [_plain(key, entry) for entry in value]
    if isinstance(value, dict):
        return _mapping(key, value)
    if value is None or isinstance(value, bool):
        return value
    if (number := _number(value)) is not None:
        return number
    if not isinstance(value, str):
        raise ValueError(f"{key} must be a finite number, a word or a list, got {value!r}")
    slope(value)
    return value


def _number(value: object) -> float | int | None:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, int):
        return value
    try:
        number = float(value)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
