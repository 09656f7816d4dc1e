"""Features of observations for networks that read a set of obstacles, beside any rays."""

from __future__ import annotations

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn
from torch.nn import functional

_OWN = ("goal", "vehicle")
"""Entries of one row, which every obstacle is seen beside."""


class DeepSets(BaseFeaturesExtractor):
    """Each obstacle through the same network, then their sum and maximum, then the rest as it is.

    What it says does not depend on the order of the obstacles, nor on rows of padding.

    Args:
        observation_space: a dictionary with obstacles and mask.
        width: of the network's two layers.

    Raises:
        ValueError: no obstacles in the observation.

    Reference:
        Zaheer et al. (2017), Deep Sets, NeurIPS 30.
    """

    def __init__(self, observation_space: spaces.Dict, width: int = 64) -> None:
        own, rays = _sizes(observation_space)
        super().__init__(observation_space, 2 * width + own + rays)
        self.each = nn.Sequential(
            nn.Linear(7 + own, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU()
        )

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        own, rows, mask = _split(seen)
        beside = own[:, None].expand(-1, rows.shape[1], -1)
        each = self.each(torch.cat([rows, beside], dim=2)) * mask[:, :, None]
        # a sum that stays near one for the usual dozen
        pooled = [each.sum(dim=1) / 8.0, each.amax(dim=1)]
        return torch.cat([*pooled, own, *_rays(seen)], dim=1)


class Attention(BaseFeaturesExtractor):
    """The vehicle and the obstacles attend to one another, then the maximum over obstacles.

    Args:
        observation_space: a dictionary with obstacles and mask.
        width: of each token.
        layers: of attention.
        heads: in each; they share the width.

    Raises:
        ValueError: no obstacles in the observation, or a width that heads cannot share.

    Reference:
        Vaswani et al. (2017), Attention is all you need, NeurIPS 30; layers are normalised first,
        as in Xiong et al. (2020), On layer normalization in the transformer architecture, ICML.
    """

    def __init__(
        self, observation_space: spaces.Dict, width: int = 64, layers: int = 2, heads: int = 4
    ) -> None:
        own, rays = _sizes(observation_space)
        if width % heads:
            raise ValueError(f"a width of {width} cannot be shared by {heads} heads")
        super().__init__(observation_space, 2 * width + own + rays)
        self.vehicle = nn.Linear(own, width)
        self.obstacle = nn.Sequential(nn.Linear(7, width), nn.SiLU(), nn.Linear(width, width))
        self.layers = nn.ModuleList([_Layer(width, heads) for _ in range(layers)])

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        own, rows, mask = _split(seen)
        tokens = torch.cat([self.vehicle(own)[:, None], self.obstacle(rows)], dim=1)
        present = torch.cat([torch.ones_like(mask[:, :1]), mask], dim=1) > 0.5
        for layer in self.layers:
            tokens = layer(tokens, present[:, None, None, :])
        best = (tokens[:, 1:] * mask[:, :, None]).amax(dim=1)
        return torch.cat([tokens[:, 0], best, own, *_rays(seen)], dim=1)


class _Layer(nn.Module):
    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self._heads = heads
        self.before = nn.LayerNorm(width)
        self.asked = nn.Linear(width, 3 * width)
        self.answered = nn.Linear(width, width)
        self.then = nn.Sequential(
            nn.LayerNorm(width),
            nn.Linear(width, 2 * width),
            nn.SiLU(),
            nn.Linear(2 * width, width),
        )

    def forward(self, tokens: Tensor, present: Tensor) -> Tensor:
        number, count, width = tokens.shape
        asked = self.asked(self.before(tokens)).view(number, count, 3, self._heads, -1)
        query, key, value = asked.permute(2, 0, 3, 1, 4)
        found = functional.scaled_dot_product_attention(query, key, value, attn_mask=present)
        tokens = tokens + self.answered(found.transpose(1, 2).reshape(number, count, width))
        return tokens + self.then(tokens)


def _sizes(space: spaces.Dict) -> tuple[int, int]:
    """Numbers of a vehicle's own entries, and of rays.

    Raises:
        ValueError: no obstacles in the observation.
    """
    sizes = {key: spaces.flatdim(one) for key, one in space.spaces.items()}
    if "obstacles" not in sizes:
        raise ValueError(
            "a network of obstacles needs to see them: observation discs or both, not rays"
        )
    return sum(sizes[key] for key in _OWN), sizes.get("rays", 0)


def _split(seen: dict[str, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
    """The vehicle's own (n, size), obstacles (n, K, 7) and mask (n, K).

    An obstacle's row and, so that networks need not find out, its direction and how near its
    surface is, finest where it is near.
    """
    own = torch.cat([seen[key] for key in _OWN], dim=1)
    rows = seen["obstacles"].view(len(own), -1, 4)
    centre = rows[:, :, :2]
    way = centre / (centre.norm(dim=2, keepdim=True) + 1e-3)
    return own, torch.cat([rows, way, torch.exp(-10.0 * rows[:, :, 3:])], dim=2), seen["mask"]


def _rays(seen: dict[str, Tensor]) -> list[Tensor]:
    return [seen["rays"]] if "rays" in seen else []
