"""Architectures that can be evaluated without torch, derived from a model card.

These are actors of the on-policy algorithms: plain or deep-sets features, fully connected layers,
and a Gaussian or a mixture of Gaussians as head. All other networks need torch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from agents.models.inference.activations import ACTIVATIONS
from agents.models.inference.features import DISC_SIZE, VEHICLE_SIZE, way_size
from agents.models.model_card import ModelCard
from ferguson_gym.simulation import settings_of

ON_POLICY = ("ppo", "bc", "dagger")
"""Algorithms with actor-critic policies; each can start from the weights of any other."""
MIXTURE = "-mixture"
"""Suffix of the names of mixture policies."""
PLAIN, SETS = "mlp", "deepsets"
"""Names of policies, after their features."""
ACTION_SIZE = 4
"""Number of entries of an action."""
_DEFAULTS: dict[str, Any] = {"activation_fn": "tanh", "components": 4}
"""Values of entries that a card leaves out."""
_TRAINING_ONLY = ("log_std_init", "ortho_init")
"""Entries of `policy_kwargs` that have no effect once weights are loaded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Architecture:
    """Sizes and kinds of the layers of an actor network."""

    sizes: dict[str, int]
    """Size of each entry of the observation."""
    width: int | None
    """Width of the deep-sets layers; None for plain features."""
    hidden: tuple[int, ...]
    """Widths of the hidden layers of the actor."""
    activation: str
    """Name of the activation after each hidden layer."""
    components: int | None
    """Number of Gaussians in the mixture; None for a single Gaussian."""

    @property
    def features(self) -> int:
        """Number of features."""
        others = 2 * self.sizes.get("rays", 0) + way_size(self.sizes.get("way", 0))
        if self.width is not None:
            return 2 * self.width + VEHICLE_SIZE + others
        return VEHICLE_SIZE + self.sizes.get("mask", 0) + self.sizes.get("obstacles", 0) + others

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of the weights by their names in torch, in the order of their use."""
        shapes: dict[str, tuple[int, ...]] = {}
        if (width := self.width) is not None:
            shapes |= {
                "features_extractor.obstacle.weight": (width, DISC_SIZE),
                "features_extractor.obstacle.bias": (width,),
                "features_extractor.vehicle.weight": (width, VEHICLE_SIZE),
                "features_extractor.then.weight": (width, width),
                "features_extractor.then.bias": (width,),
            }
        before = self.features
        for number, size in enumerate(self.hidden):
            name = f"mlp_extractor.policy_net.{2 * number}"
            shapes |= {f"{name}.weight": (size, before), f"{name}.bias": (size,)}
            before = size
        rows = ACTION_SIZE if self.components is None else self.components * (1 + 2 * ACTION_SIZE)
        return shapes | {"action_net.weight": (rows, before), "action_net.bias": (rows,)}


def architecture_of(card: ModelCard) -> Architecture | None:
    """The architecture that a card describes; None if only torch can build it, or nothing can."""
    given = dict(card.policy_kwargs)
    layers = _layers(given.pop("net_arch", None))
    extractor = given.pop("features_extractor_kwargs", {})
    mixes = card.policy.endswith(MIXTURE)
    features = card.policy.removesuffix(MIXTURE)
    sizes = settings_of(card.environment).layout.entries()
    settings = {**_DEFAULTS, **given}
    sets = features == SETS
    if (
        card.algorithm not in ON_POLICY
        or features not in (PLAIN, SETS)
        or layers is None
        or not set(given) <= {"activation_fn", *_TRAINING_ONLY, *(["components"] if mixes else [])}
        or settings["activation_fn"] not in list(ACTIVATIONS)  # a list: it may not be hashable
        or not _is_size(settings["components"])
        or type(extractor) is not dict
        or not set(extractor) <= ({"width"} if sets else set())
        or not _is_size(width := extractor.get("width", 64))
        or (sets and "obstacles" not in sizes)
    ):
        return None
    return Architecture(
        sizes=sizes,
        width=width if sets else None,
        hidden=tuple(layers),
        activation=settings["activation_fn"],
        components=settings["components"] if mixes else None,
    )


def _layers(given: Any) -> Sequence[int] | None:
    """Widths of an actor's layers as Stable-Baselines3 reads them; None if it would refuse."""
    if given is None:
        return [64, 64]
    if type(given) is dict:
        given = given.get("pi", [])
    return given if type(given) is list and all(map(_is_size, given)) else None


def _is_size(given: Any) -> bool:
    return type(given) is int and given >= 1
