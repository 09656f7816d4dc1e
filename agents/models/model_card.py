"""Model cards: `model.json`, which describes a model and is stored next to its weights."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ferguson_gym import ENVIRONMENT_ID, __version__
from ferguson_gym.runtime import atomic_write
from ferguson_gym.simulation import arguments_to_save, saved_arguments, settings_of
from ferguson_gym.world import PAPER_LIMITS
from planners.interface import Knowledge

CARD = "model.json"
ENVIRONMENT_VERSION = f"{ENVIRONMENT_ID} {__version__}"
"""Id of the environment and version of the package, as new cards record them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCard:
    """How a model was made, what it observes and what it reaches; JSON values only."""

    algorithm: str
    """Algorithm that trained the model, for example ppo."""
    policy: str
    """Name in `agents.models.networks.POLICIES`."""
    policy_kwargs: dict[str, Any]
    """Arguments of the policy as in the YAML file; classes are given by name."""
    environment: dict[str, Any]
    """Arguments of the environment in which it was trained; they define the observation."""
    environment_version: str = ENVIRONMENT_VERSION
    """Id of the environment and version of the package."""
    seed: int = 0
    """Seed of the training."""
    versions: dict[str, Any] = field(default_factory=dict)
    """Versions of the libraries."""
    commit: str | None = None
    """Commit of the sources; None if they were not a Git checkout."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the training run, hyperparameters included."""
    curve: list[dict[str, Any]] = field(default_factory=list)
    """Evaluations during training, in order."""
    results: dict[str, Any] = field(default_factory=dict)
    """Final results, with fields and number of flights."""

    @property
    def knows(self) -> Knowledge:
        """What the observation shows of a field.

        Rays and discs end at the range `view`. Directions of the shortest path, which the argument
        `way` adds to the observation, depend on all obstacles.
        """
        return Knowledge.WHOLE_FIELD if self.environment.get("way") else Knowledge.NEARBY

    def to_json(self) -> str:
        """The text of `model.json`.

        Raises:
            ValueError: A number is not finite.
        """
        entries = dataclasses.asdict(self)
        entries["environment"] = arguments_to_save(self.environment)
        return json.dumps(entries, indent=1, allow_nan=False) + "\n"


def write_card(directory: Path, card: ModelCard) -> None:
    """Write `model.json` into an existing directory.

    Raises:
        ValueError: A number is not finite; nothing is written.
    """
    text = card.to_json()
    with atomic_write(directory / CARD) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_card(path: Path) -> ModelCard:
    """Read a card from a file.

    Raises:
        ValueError: As `parse_card`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not JSON, or cut short") from None
    return parse_card(text, str(path))


def parse_card(text: str, where: str = "card") -> ModelCard:
    """Parse a card from the text that `ModelCard.to_json` writes.

    Raises:
        ValueError: The text is not a card, or the model was made for another environment.
    """
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError(f"{where}: not JSON, or cut short") from None
    fields = {entry.name: entry for entry in dataclasses.fields(ModelCard)}
    if not isinstance(entries, dict) or set(entries) != set(fields):
        raise ValueError(f"{where}: not a model's card; it has the entries {', '.join(fields)}")
    kinds = {"str": str, "int": int, "dict[str, Any]": dict, "list[dict[str, Any]]": list}
    for name, entry in fields.items():
        kind = kinds.get(str(entry.type))
        if kind is not None and type(entries[name]) is not kind:
            raise ValueError(f"{where}: {name} should be of type {kind.__name__}")
    entries["environment"] = saved_arguments(entries["environment"])
    card = ModelCard(**entries)
    _check_version(card, where)
    check_environment(card.environment, f"{where}: ")
    return card


def _check_version(card: ModelCard, where: str) -> None:
    known, _, version = card.environment_version.partition(" ")
    if known != ENVIRONMENT_ID:
        reason = f"for the environment {known!r}, and this is {ENVIRONMENT_ID}"
        raise ValueError(f"{where}: a model {reason}")
    if _number(version) > _number(__version__):
        reason = f"ferguson-gym {version}, newer than {__version__} which is installed"
        raise ValueError(f"{where}: a model made with {reason}")


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(digits) for digits in re.findall(r"\d+", version)[:3])


def check_environment(arguments: Mapping[str, Any], where: str = "") -> None:
    """Check that a policy trained with these environment arguments can be evaluated.

    Raises:
        ValueError: The environment refuses the arguments, or they change the limits of a flight.
    """
    try:
        settings = settings_of(dict(arguments))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}{error}") from None
    if settings.flat or settings.pool is not None:
        raise ValueError(
            f"{where}agents observe a dictionary, and a model does not hold the fields that it was "
            "trained on; leave `flat` out, and give `fields` as a number"
        )
    if settings.gate not in (None, PAPER_LIMITS.gate) or settings.segments not in (
        None,
        PAPER_LIMITS.segments,
    ):
        raise ValueError(
            f"{where}agents fly with the gate ({PAPER_LIMITS.gate:g} m) and the number of segments "
            f"({PAPER_LIMITS.segments}) that evaluations have; leave `gate` and `segments` out"
        )
