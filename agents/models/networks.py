"""Policy classes of Stable-Baselines3 by the names that YAML files and cards use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sb3_contrib.tqc.policies import MultiInputPolicy as TQCPolicy
from stable_baselines3.common.policies import BasePolicy, MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from agents.models.architecture import MIXTURE, ON_POLICY, PLAIN, SETS
from agents.models.extractors import DeepSets, Plain
from agents.models.mixture import MixturePolicy

_FEATURES: dict[str, type[BaseFeaturesExtractor]] = {PLAIN: Plain, SETS: DeepSets}
POLICIES = (*_FEATURES, *(f"{name}{MIXTURE}" for name in _FEATURES))
"""Names of policies."""

_CLASSES: dict[str, type[BasePolicy]] = {
    **dict.fromkeys(ON_POLICY, MultiInputActorCriticPolicy),
    "tqc": TQCPolicy,
}
_ACTIVATIONS: dict[str, type[nn.Module]] = {
    kind.__name__.lower(): kind for kind in (nn.ELU, nn.GELU, nn.ReLU, nn.SiLU, nn.Tanh)
}


def policy_class(algorithm: str, name: str) -> type[BasePolicy]:
    """The policy class for an algorithm, over dictionary observations.

    Raises:
        ValueError: The algorithm or policy is unknown, or the two do not go together.
    """
    if algorithm not in _CLASSES:
        raise ValueError(f"unknown algorithm {algorithm!r}; known are {', '.join(_CLASSES)}")
    if name not in POLICIES:
        raise ValueError(f"unknown policy {name!r}; policies are {', '.join(POLICIES)}")
    if not name.endswith(MIXTURE):
        return _CLASSES[algorithm]
    if algorithm not in ON_POLICY:
        raise ValueError(
            f"{algorithm} takes no policy {name!r}; {', '.join(ON_POLICY)} do, and it takes "
            f"{', '.join(_FEATURES)}"
        )
    return MixturePolicy


def sb3_policy_kwargs(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """`policy_kwargs` of a YAML file or a card as Stable-Baselines3 expects them: with classes.

    Raises:
        ValueError: The activation is unknown.
    """
    kwargs = dict(given)
    if (activation := kwargs.get("activation_fn")) is not None:
        if activation not in _ACTIVATIONS:
            raise ValueError(
                f"unknown activation_fn {activation!r}; known are {', '.join(_ACTIVATIONS)}"
            )
        kwargs["activation_fn"] = _ACTIVATIONS[activation]
    extractor = _FEATURES[name.removesuffix(MIXTURE)]
    return {**kwargs, "features_extractor_class": extractor}
