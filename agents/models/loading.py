"""Learned policies on disk: a directory with `model.zip`, the weights, and `model.json`, the card.

A model is loaded without unpickling: the card says what the network is, and of the zip the
weights alone are read. Networks that are known here as numbers fly without torch; the others need
it, and so does training (`agents.models.torch_model`).
"""

from __future__ import annotations

from pathlib import Path

from agents.models import weights
from agents.models.architecture import Architecture, architecture_of
from agents.models.inference.forward import Forward
from agents.models.model import MODEL, Model, directory_of
from agents.models.model_card import CARD, Card, read_card
from ferguson_gym.runtime.optional_dependencies import installing


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
        from agents.models import torch_model
    except ImportError as error:
        raise ValueError(
            f"the model in {directory} needs {error.name}: {installing('agents')}"
        ) from None
    return torch_model.load(directory).model


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
