"""Learned policies on disk: a directory with `model.zip`, the weights, and `model.json`, the card.

A model is loaded without unpickling: the card says what the network is, and of the zip the
weights alone are read. Networks that are known here as numbers fly without torch; the others need
it, and so does training (`agents.torch_models`).
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from agents import weights
from agents.architecture import Architecture, architecture_of
from agents.cards import CARD, Card, read_card
from agents.forward import Forward
from ferguson_gym.actions import Action
from ferguson_gym.interface import settings_of
from ferguson_gym.observations import Observation
from ferguson_gym.settings import Settings
from planners.extras import installing

MODEL = "model.zip"


class Network(Protocol):
    """What a pilot asks."""

    def act(self, seen: Observation) -> Action:
        """The actions (n, 4) that it thinks best; of each row the same, whatever the others.

        Args:
            seen: (n, size) of each entry.
        """

    def at_work(self) -> AbstractContextManager[None]:
        """While it is asked often: what it changes in the process, it changes back at the end."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A learned policy and what is known of it."""

    network: Network
    card: Card

    @property
    def settings(self) -> Settings:
        """Of the environment it was trained in."""
        return settings_of(self.card.environment)


def load(place: str | Path) -> Model:
    """The model that lies in a directory, or beside its `model.zip`.

    Raises:
        ValueError: there is none, or it is not whole, not a model, or not one of this
            environment, or it needs torch, which is not installed; the message says which.
    """
    directory = directory_of(place)
    card = read_card(directory / CARD)
    architecture = _known(directory, card)
    if architecture is not None:
        read = weights.read(directory / MODEL, architecture.shapes)
        return Model(Forward(architecture, read), card)
    try:
        from agents import torch_models
    except ImportError as error:
        raise ValueError(
            f"the model in {directory} needs {error.name}: {installing('agents')}"
        ) from None
    return torch_models.load(directory).model


def needs_torch(place: Path) -> bool:
    """Whether a model flies by torch alone.

    Raises:
        ValueError: there is no model, or one that cannot be read.
    """
    directory = directory_of(place)
    return _known(directory, read_card(directory / CARD)) is None


def _known(directory: Path, card: Card) -> Architecture | None:
    """A model's network, if it is known as numbers and so are its weights."""
    return architecture_of(card) if weights.names(directory / MODEL) else None


def directory_of(place: str | Path) -> Path:
    """The directory of a model, given by itself or by the zip in it.

    Raises:
        ValueError: there is none, or it is not whole.
    """
    given = Path(place)
    directory = given.parent if given.name == MODEL else given
    if missing := [name for name in (MODEL, CARD) if not (directory / name).is_file()]:
        raise ValueError(
            f"no model in {directory}: {' and '.join(missing)} "
            f"{'is' if len(missing) == 1 else 'are'} missing; a model is a directory with {MODEL} "
            f"and {CARD}"
        )
    return directory
