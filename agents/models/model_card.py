"""Cards of models: what is known of one, `model.json` beside its weights."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ferguson_gym import ENVIRONMENT_ID, __version__
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world.limits import PAPER_LIMITS

CARD = "model.json"
ENVIRONMENT_VERSION = f"{ENVIRONMENT_ID} {__version__}"
"""The environment that models are made for: its id, and the version of the package."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """What is known of a model; JSON values only."""

    algorithm: str
    """That trained it, for example ppo."""
    policy: str
    """Name in `agents.models.networks.POLICIES`."""
    policy_kwargs: dict[str, Any]
    """As YAML has them, classes by name."""
    environment: dict[str, Any]
    """Arguments of the environment it was trained in; they say what it sees."""
    environment_version: str = ENVIRONMENT_VERSION
    """Id of the environment, and version of the package."""
    seed: int = 0
    """Of the training."""
    versions: dict[str, Any] = field(default_factory=dict)
    """Of the libraries."""
    commit: str | None = None
    """Of the sources, if they were a checkout."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Hyperparameters as used."""
    curve: list[dict[str, Any]] = field(default_factory=list)
    """Evaluations while training, in order."""
    results: dict[str, Any] = field(default_factory=dict)
    """What the model reaches, on which fields, of how many flights."""

    def to_json(self) -> str:
        """As `model.json` has it.

        Raises:
            ValueError: a number that is not finite.
        """
        return json.dumps(dataclasses.asdict(self), indent=1, allow_nan=False) + "\n"


def write_card(directory: Path, card: Card) -> None:
    """Write a card into a directory that exists.

    Raises:
        ValueError: a number that is not finite; then nothing is written.
    """
    text = card.to_json()
    with atomic_write(directory / CARD) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_card(path: Path) -> Card:
    """The card in a file.

    Raises:
        ValueError: it is none, or one of another environment.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not JSON, or cut short") from None
    return card_from(text, str(path))


def card_from(text: str, where: str = "card") -> Card:
    """The card in a text, as `Card.to_json` wrote it.

    Raises:
        ValueError: it is none, or one of another environment; the message begins with `where`.
    """
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError(f"{where}: not JSON, or cut short") from None
    fields = {one.name: one for one in dataclasses.fields(Card)}
    if not isinstance(entries, dict) or set(entries) != set(fields):
        raise ValueError(f"{where}: not a model's card; it has the entries {', '.join(fields)}")
    kinds = {"str": str, "int": int, "dict[str, Any]": dict, "list[dict[str, Any]]": list}
    for name, one in fields.items():
        kind = kinds.get(str(one.type))
        if kind is not None and type(entries[name]) is not kind:
            raise ValueError(f"{where}: {name} should be of type {kind.__name__}")
    card = Card(**entries)
    _check_version(card, where)
    check_environment(card.environment, f"{where}: ")
    return card


def _check_version(card: Card, where: str) -> None:
    known, _, version = card.environment_version.partition(" ")
    if known != ENVIRONMENT_ID:
        raise ValueError(
            f"{where}: a model for the environment {known!r}, and this is {ENVIRONMENT_ID}"
        )
    if _number(version) > _number(__version__):
        raise ValueError(
            f"{where}: a model made with ferguson-gym {version}, newer than {__version__} which is "
            "installed"
        )


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(digits) for digits in re.findall(r"\d+", version)[:3])


def check_environment(arguments: Mapping[str, Any], where: str = "") -> None:
    """See that a policy trained with these arguments can be flown like any other.

    Raises:
        ValueError: arguments that the environment refuses, or that change what a flight is;
            the message begins with `where`.
    """
    try:
        settings = settings_of(dict(arguments))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}{error}") from None
    if settings.limits != PAPER_LIMITS:
        raise ValueError(
            f"{where}agents fly with the gate ({PAPER_LIMITS.gate:g} m) and the number of segments "
            f"({PAPER_LIMITS.segments}) that evaluations have; leave `gate` and `segments` out"
        )
