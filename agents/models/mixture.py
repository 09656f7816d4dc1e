"""Mixture-of-Gaussians policies: they can choose either side of an obstacle, not the mean of both.

Reference:
    Bishop (1994), Mixture density networks, Aston University NCRG/94/004.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from torch import Tensor, nn

from agents.models.inference.heads import AGREEMENT, MEAN_SCALE

MIN_STD, MAX_STD = 0.02, 1.0
"""Bounds on the standard deviation of a component, in units of actions."""
_NORMAL = 0.5 * math.log(2.0 * math.pi)


class Mixture(DiagGaussianDistribution):
    """A mixture of `components` Gaussians with diagonal, state-dependent covariances."""

    def __init__(self, action_dim: int, components: int) -> None:
        super().__init__(action_dim)
        self.components = components

    def proba_distribution_net(
        self, latent_dim: int, log_std_init: float = 0.0
    ) -> tuple[nn.Module, nn.Parameter]:
        """The layer of weights, means and log spreads, and the offset (action_dim,) of the last."""
        size = self.components * (1 + 2 * self.action_dim)
        return nn.Linear(latent_dim, size), nn.Parameter(
            torch.full((self.action_dim,), float(log_std_init))
        )

    def proba_distribution(self, mean_actions: Tensor, log_std: Tensor) -> Mixture:
        """Set the parameters for n states.

        Args:
            mean_actions: (n, components (1 + 2 action_dim)) output of the layer.
            log_std: (action_dim,) offset of the log standard deviations.
        """
        rows = mean_actions.view(len(mean_actions), self.components, 1 + 2 * self.action_dim)
        self.log_weights = torch.log_softmax(rows[:, :, 0], dim=1)
        self.means = MEAN_SCALE * rows[:, :, 1 : 1 + self.action_dim]
        spreads = rows[:, :, 1 + self.action_dim :] + log_std
        # clamped before the exponential, whose gradient is NaN where it overflows
        self.spreads = spreads.clamp(math.log(MIN_STD), math.log(MAX_STD)).exp()
        return self

    def log_prob(self, actions: Tensor) -> Tensor:
        """Log density (n,) of actions (n, action_dim)."""
        away = (actions[:, None] - self.means) / self.spreads
        each = -0.5 * away.square() - self.spreads.log() - _NORMAL
        return torch.logsumexp(self.log_weights + each.sum(dim=2), dim=1)

    def entropy(self) -> None:
        """Return None: the entropy of a mixture has no closed form."""

    def sample(self) -> Tensor:
        """Actions (n, action_dim)."""
        which = torch.multinomial(self.log_weights.exp(), 1)[:, 0]
        rows = torch.arange(len(which))
        return torch.normal(self.means[rows, which], self.spreads[rows, which])

    def mode(self) -> Tensor:
        """Actions (n, action_dim): the mean over the most probable group of similar components.

        The maximum of the density would favour the narrowest component. Compiled version:
        `agents.models.inference.heads.mixture_mode`.
        """
        weights = self.log_weights.exp()
        apart = (self.means[:, :, None] - self.means[:, None]).square().sum(dim=3)
        alike = torch.exp(-apart / (2.0 * AGREEMENT**2)) * weights[:, None]
        rows = torch.arange(len(weights))
        chosen = alike[rows, alike.sum(dim=2).argmax(dim=1)]
        return (chosen[:, :, None] * self.means).sum(dim=1) / chosen.sum(dim=1, keepdim=True)


class MixturePolicy(MultiInputActorCriticPolicy):
    """Actor-critic policy over dictionary observations whose actor is a mixture of Gaussians.

    Its arguments are the number of Gaussians and those of `MultiInputActorCriticPolicy`.
    Orthogonal initialisation is always off: its small gain makes all components nearly equal.

    Raises:
        ValueError: `components` is not a positive integer.
    """

    def __init__(self, *args: Any, components: int = 4, **kwargs: Any) -> None:
        if type(components) is not int or components < 1:
            raise ValueError(f"components must be an integer >= 1, got {components!r}")
        self.components = components
        super().__init__(*args, **{**kwargs, "ortho_init": False})

    def _build(self, lr_schedule: Any) -> None:
        self.action_dist = Mixture(spaces.flatdim(self.action_space), self.components)
        super()._build(lr_schedule)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        parameters: dict[str, Any] = super()._get_constructor_parameters()
        del parameters["ortho_init"]
        return {**parameters, "components": self.components}
