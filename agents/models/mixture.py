"""Policies that mix Gaussians: one way past an obstacle or the other, and nothing in between."""

from __future__ import annotations

import math
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from torch import Tensor, nn

from agents.models.inference.heads import LIKE, SCALE

FINEST, COARSEST = 0.02, 1.0
"""Least and greatest standard deviation of a component, on the scale of actions."""
_NORMAL = 0.5 * math.log(2.0 * math.pi)


class Mixture(DiagGaussianDistribution):
    """A mixture of Gaussians with diagonal covariances, which the state decides on.

    Args:
        action_dim: size of actions.
        components: number of Gaussians.
    """

    def __init__(self, action_dim: int, components: int) -> None:
        super().__init__(action_dim)
        self.components = components

    def proba_distribution_net(
        self, latent_dim: int, log_std_init: float = 0.0
    ) -> tuple[nn.Module, nn.Parameter]:
        """A layer for weights, means and spreads, and what is added to the log of all spreads."""
        size = self.components * (1 + 2 * self.action_dim)
        return nn.Linear(latent_dim, size), nn.Parameter(
            torch.full((self.action_dim,), float(log_std_init))
        )

    def proba_distribution(self, mean_actions: Tensor, log_std: Tensor) -> Mixture:
        """Set the parameters, for n states at once.

        Args:
            mean_actions: (n, components (1 + 2 action_dim)) what the layer says.
            log_std: (action_dim,).
        """
        rows = mean_actions.view(len(mean_actions), self.components, 1 + 2 * self.action_dim)
        self.log_weights = torch.log_softmax(rows[:, :, 0], dim=1)
        self.means = SCALE * rows[:, :, 1 : 1 + self.action_dim]
        spreads = rows[:, :, 1 + self.action_dim :] + log_std
        # before the exponential: what overflows there has no gradient but NaN
        self.spreads = spreads.clamp(math.log(FINEST), math.log(COARSEST)).exp()
        return self

    def log_prob(self, actions: Tensor) -> Tensor:
        """Log density (n,) of actions (n, action_dim)."""
        away = (actions[:, None] - self.means) / self.spreads
        each = -0.5 * away.square() - self.spreads.log() - _NORMAL
        return torch.logsumexp(self.log_weights + each.sum(dim=2), dim=1)

    def entropy(self) -> None:
        """None: a mixture has no closed form of it."""

    def sample(self) -> Tensor:
        """Actions (n, action_dim)."""
        which = torch.multinomial(self.log_weights.exp(), 1)[:, 0]
        rows = torch.arange(len(which))
        return torch.normal(self.means[rows, which], self.spreads[rows, which])

    def mode(self) -> Tensor:
        """Actions (n, action_dim): the mean of the components that agree on the likeliest way.

        The density's own maximum would be wherever a component is narrowest.
        `agents.models.inference.heads` has the same compiled.
        """
        weights = self.log_weights.exp()
        apart = (self.means[:, :, None] - self.means[:, None]).square().sum(dim=3)
        alike = torch.exp(-apart / (2.0 * LIKE**2)) * weights[:, None]
        rows = torch.arange(len(weights))
        chosen = alike[rows, alike.sum(dim=2).argmax(dim=1)]
        return (chosen[:, :, None] * self.means).sum(dim=1) / chosen.sum(dim=1, keepdim=True)


class MixturePolicy(MultiInputActorCriticPolicy):
    """An actor that mixes Gaussians, and a critic, over observations that are dictionaries.

    Args:
        args: as of `MultiInputActorCriticPolicy`.
        components: number of Gaussians.
        kwargs: as of `MultiInputActorCriticPolicy`. Layers are not orthogonal at first: the
            components would be all the same.

    Raises:
        ValueError: a number of components that is none.

    Reference:
        Bishop (1994), Mixture density networks, Aston University NCRG/94/004.
    """

    def __init__(self, *args: Any, components: int = 4, **kwargs: Any) -> None:
        if type(components) is not int or components < 1:
            raise ValueError(f"components must be a whole number from 1 on, got {components!r}")
        self.components = components
        super().__init__(*args, **{**kwargs, "ortho_init": False})

    def _build(self, lr_schedule: Any) -> None:
        self.action_dist = Mixture(spaces.flatdim(self.action_space), self.components)
        super()._build(lr_schedule)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        parameters: dict[str, Any] = super()._get_constructor_parameters()
        del parameters["ortho_init"]
        return {**parameters, "components": self.components}
