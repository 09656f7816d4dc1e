"""What a card's network is made of, if it is one that flies without torch.

Those are actors of the on-policy algorithms with plain features or sets of obstacles, layers, and
a Gaussian or a mixture on top. Others fly by torch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from agents.models.inference.activations import ACTIVATIONS
from agents.models.inference.features import DISC, OWN
from agents.models.model_card import Card
from ferguson_gym.simulation.settings import settings_of

ON_POLICY = ("ppo", "bc", "dagger")
"""Algorithms whose policies are actor and critic in one, and take one another's weights."""
MIXTURE = "-mixture"
"""Ends the name of a policy that mixes Gaussians."""
PLAIN, SETS = "mlp", "deepsets"
"""Policies by their features."""
ACTION = 4
"""Size of actions."""
_USUAL: dict[str, Any] = {"activation_fn": "tanh", "components": 4}
"""Where a card is silent."""
_OF_TRAINING = ("log_std_init", "ortho_init")
"""Entries of `policy_kwargs` that change nothing once weights are loaded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Architecture:
    """A network in numbers."""

    sizes: dict[str, int]
    """Of each entry that it sees."""
    width: int | None
    """Of the layers that obstacles pass, as a set; None: features are plain."""
    hidden: tuple[int, ...]
    """Widths of the layers of the actor."""
    activation: str
    """After each of them."""
    components: int | None
    """Gaussians in the mixture; None: it is no mixture."""

    @property
    def features(self) -> int:
        """Number of features."""
        rays = 2 * self.sizes.get("rays", 0)
        if self.width is not None:
            return 2 * self.width + OWN + rays
        return OWN + self.sizes.get("mask", 0) + self.sizes.get("obstacles", 0) + rays

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Of its weights, by their names in torch; in the order in which they are used."""
        shapes: dict[str, tuple[int, ...]] = {}
        if (width := self.width) is not None:
            shapes |= {
                "features_extractor.obstacle.weight": (width, DISC),
                "features_extractor.obstacle.bias": (width,),
                "features_extractor.vehicle.weight": (width, OWN),
                "features_extractor.then.weight": (width, width),
                "features_extractor.then.bias": (width,),
            }
        before = self.features
        for number, size in enumerate(self.hidden):
            name = f"mlp_extractor.policy_net.{2 * number}"
            shapes |= {f"{name}.weight": (size, before), f"{name}.bias": (size,)}
            before = size
        rows = ACTION if self.components is None else self.components * (1 + 2 * ACTION)
        return shapes | {"action_net.weight": (rows, before), "action_net.bias": (rows,)}


def architecture_of(card: Card) -> Architecture | None:
    """The network of a card; None if it is none that is known here, or makes no sense."""
    given = dict(card.policy_kwargs)
    layers = _layers(given.pop("net_arch", None))
    of_features = given.pop("features_extractor_kwargs", {})
    mixes = card.policy.endswith(MIXTURE)
    features = card.policy.removesuffix(MIXTURE)
    sizes = settings_of(card.environment).layout.entries()
    told = {**_USUAL, **given}
    sets = features == SETS
    if (
        card.algorithm not in ON_POLICY
        or features not in (PLAIN, SETS)
        or layers is None
        or not set(given) <= {"activation_fn", *_OF_TRAINING, *(["components"] if mixes else [])}
        or told["activation_fn"] not in list(ACTIVATIONS)  # which need not be hashable
        or not _is_size(told["components"])
        or type(of_features) is not dict
        or not set(of_features) <= ({"width"} if sets else set())
        or not _is_size(width := of_features.get("width", 64))
        or (sets and "obstacles" not in sizes)
    ):
        return None
    return Architecture(
        sizes=sizes,
        width=width if sets else None,
        hidden=tuple(layers),
        activation=told["activation_fn"],
        components=told["components"] if mixes else None,
    )


def _layers(given: Any) -> Sequence[int] | None:
    """Widths of an actor's layers as Stable-Baselines3 reads them; None if it would not."""
    if given is None:
        return [64, 64]
    if type(given) is dict:
        given = given.get("pi", [])
    return given if type(given) is list and all(_is_size(one) for one in given) else None


def _is_size(given: Any) -> bool:
    return type(given) is int and given >= 1
