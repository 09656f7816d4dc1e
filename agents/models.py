"""Learned policies on disk: a directory with `model.zip`, the weights, and `model.json`, the card.

A model is loaded without unpickling: the card says what the network is, and of the zip the
weights alone are read.
"""

from __future__ import annotations

import dataclasses
import json
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy

from agents import networks
from ferguson_gym import ENVIRONMENT_ID, __version__
from ferguson_gym.files import written_whole
from ferguson_gym.interface import action_space, observation_space, settings_of
from ferguson_gym.limits import PAPER_LIMITS
from ferguson_gym.settings import Settings

MODEL, CARD = "model.zip", "model.json"
ENVIRONMENT_VERSION = f"{ENVIRONMENT_ID} {__version__}"
"""The environment that models are made for: its id, and the version of the package."""
_WEIGHTS = "policy.pth"
_KEPT = (_WEIGHTS, "_stable_baselines3_version")
_NOT_DATA = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf", "ep_info_buffer")
"""Attributes left out of the zip: functions of a training that is over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """What is known of a model; JSON values only."""

    algorithm: str
    """That trained it, for example ppo."""
    policy: str
    """Name in `agents.networks.POLICIES`."""
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


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A learned policy and what is known of it."""

    policy: BasePolicy
    """On the processor."""
    card: Card

    @property
    def settings(self) -> Settings:
        """Of the environment it was trained in."""
        return settings_of(self.card.environment)


def save(directory: Path, model: BaseAlgorithm, card: Card) -> None:
    """Write a model into a directory that exists; each file is written whole."""
    text = card.to_json()
    with written_whole(directory / MODEL) as temporary:
        model.save(temporary, exclude=_NOT_DATA)
    _write_card(directory, text)


def slim(source: Path, directory: Path) -> None:
    """Copy a model without what only training needs, for example the optimizer's state.

    Raises:
        ValueError: as `load`.
    """
    model = load(source)
    directory.mkdir(parents=True, exist_ok=True)
    with (
        zipfile.ZipFile(_directory(source) / MODEL) as whole,
        written_whole(directory / MODEL) as temporary,
        zipfile.ZipFile(temporary, "w") as part,
    ):
        for name in _KEPT:
            # without the time, so that copies are equal
            part.writestr(zipfile.ZipInfo(name), whole.read(name), zipfile.ZIP_DEFLATED)
    _write_card(directory, model.card.to_json())


def _write_card(directory: Path, text: str) -> None:
    with written_whole(directory / CARD) as temporary:
        temporary.write_text(text, encoding="utf-8")


def load(place: str | Path) -> Model:
    """The model that lies in a directory, or beside its `model.zip`.

    Raises:
        ValueError: there is none, or it is not whole, not a model, or not one of this
            environment; the message says which.
    """
    directory = _directory(place)
    card = read_card(directory / CARD)
    policy = build(card, f"{directory / CARD}: ")
    weights = _read_weights(directory / MODEL)
    try:
        policy.load_state_dict(weights)
    except (RuntimeError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{directory / MODEL}: its weights are not those of the network that {CARD} describes "
            f"({_first_line(error)})"
        ) from None
    if not all(torch.isfinite(weight).all() for weight in policy.state_dict().values()):
        raise ValueError(f"{directory / MODEL}: weights that are not finite")
    policy.set_training_mode(False)
    return Model(policy, card)


def build(card: Card, where: str = "") -> BasePolicy:
    """The network that a card describes, with weights drawn at random.

    Raises:
        ValueError: no network can be built of it; the message begins with `where`.
    """
    try:
        kind = networks.policy_class(card.algorithm, card.policy)
        kwargs = networks.features(card.policy, card.policy_kwargs)
        seen = observation_space(settings_of(card.environment))
        return kind(seen, action_space(), lambda _: 0.0, **kwargs)
    except (ValueError, TypeError, AssertionError, RuntimeError, KeyError) as error:
        raise ValueError(f"{where}{_first_line(error)}") from None


def _directory(place: str | Path) -> Path:
    given = Path(place)
    directory = given.parent if given.name == MODEL else given
    if missing := [name for name in (MODEL, CARD) if not (directory / name).is_file()]:
        raise ValueError(
            f"no model in {directory}: {' and '.join(missing)} "
            f"{'is' if len(missing) == 1 else 'are'} missing; a model is a directory with {MODEL} "
            f"and {CARD}"
        )
    return directory


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


def _read_weights(path: Path) -> dict[str, torch.Tensor]:
    try:
        with zipfile.ZipFile(path) as archive, archive.open(_WEIGHTS) as file:
            weights = torch.load(file, map_location="cpu", weights_only=True)
    except KeyError:
        raise ValueError(
            f"{path}: no {_WEIGHTS} in it: cut short, or no model that was saved here"
        ) from None
    except (zipfile.BadZipFile, EOFError, OSError):
        raise ValueError(f"{path}: not a zip file, or cut short") from None
    except Exception as error:  # torch promises no kinds; whatever it is, these are no weights
        raise ValueError(
            f"{path}: {_WEIGHTS} does not hold weights alone, and nothing else is read "
            f"({type(error).__name__})"
        ) from None
    if not isinstance(weights, dict):
        raise ValueError(f"{path}: {_WEIGHTS} does not hold weights")
    return weights


def _first_line(error: BaseException) -> str:
    """Of a message that may be long, what matters."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[1] if len(lines) > 1 and lines[0].endswith(":") else " ".join(lines[:1])
