"""Load a learned policy from its directory: `model.zip` (weights) and `model.json` (card).

Nothing is unpickled: the card describes the network, and only the weights of the zip are read.
Networks with compiled kernels (`agents.models.architecture`) fly without torch; the others need
it, and so does training (`agents.models.torch_model`).
"""

from __future__ import annotations

from pathlib import Path

from agents.models import weights
from agents.models.architecture import Architecture, architecture_of
from agents.models.inference.forward import CompiledNetwork
from agents.models.model import MODEL, Model, directory_of
from agents.models.model_card import CARD, ModelCard, read_card
from ferguson_gym.runtime.optional_dependencies import installing


def load(place: str | Path) -> Model:
    """Load a model.

    Args:
        place: directory of the model, or the `model.zip` in it.

    Raises:
        ValueError: There is no model, a file is missing or damaged, the model was made for
            another environment, or it needs torch, which is not installed.
    """
    directory = directory_of(place)
    card = read_card(directory / CARD)
    if (architecture := _compiled_architecture(directory, card)) is not None:
        read = weights.read(directory / MODEL, architecture.shapes)
        return Model(CompiledNetwork(architecture, read), card)
    try:
        from agents.models import torch_model
    except ImportError as error:
        needed = f"{error.name}: {installing('agents')}"
        raise ValueError(f"the model in {directory} needs {needed}") from None
    return torch_model.load(directory).model


def needs_torch(place: Path) -> bool:
    """Whether a model needs torch to fly.

    Raises:
        ValueError: There is no model, or it cannot be read.
    """
    directory = directory_of(place)
    return _compiled_architecture(directory, read_card(directory / CARD)) is None


def _compiled_architecture(directory: Path, card: ModelCard) -> Architecture | None:
    """A model's architecture if kernels exist for it and its weights are stored as arrays."""
    return architecture_of(card) if weights.names(directory / MODEL) else None
