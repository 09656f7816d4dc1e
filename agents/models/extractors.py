"""Features of observations: plain, or of obstacles as the set that they are.

All of them show near things on a finer scale too: a metre matters beside an obstacle and on the
last segments before the goal, and is little of all that lengths are parts of.
`agents.models.inference.features` has the first two as flights use them, compiled.
"""

from __future__ import annotations

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn
from torch.nn import functional

from agents.models.inference.features import DISC, FALL, GRAIN, NEARER, OWN, USUAL


class Plain(BaseFeaturesExtractor):
    """All that is seen, one after the other, and how near rays end.

    Args:
        observation_space: a dictionary of the environment's.
    """

    def __init__(self, observation_space: spaces.Dict) -> None:
        sizes = {key: spaces.flatdim(one) for key, one in observation_space.spaces.items()}
        rows = sizes.get("mask", 0) + sizes.get("obstacles", 0)
        super().__init__(observation_space, OWN + rows + 2 * sizes.get("rays", 0))

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        rows = [seen[key] for key in ("mask", "obstacles") if key in seen]
        return torch.cat([_own(seen), *rows, *_rays(seen)], dim=1)


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
        super().__init__(observation_space, 2 * width + OWN + _rays_of(observation_space))
        self.obstacle = nn.Linear(DISC, width)
        self.vehicle = nn.Linear(OWN, width, bias=False)
        self.then = nn.Linear(width, width)

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        own, rows, mask = _split(seen)
        # one layer of both, without a copy of the vehicle beside each obstacle
        first = torch.relu(self.obstacle(rows) + self.vehicle(own)[:, None])
        each = torch.relu(self.then(first)) * mask[:, :, None]
        # a sum that stays near one for the usual dozen
        pooled = [each.sum(dim=1) / USUAL, each.amax(dim=1)]
        return torch.cat([*pooled, own, *_rays(seen)], dim=1)


class Attention(BaseFeaturesExtractor):
    """The vehicle and the obstacles attend to one another, then the maximum over obstacles.

    What it says does not depend on the order of the obstacles, nor on rows of padding.

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
        if width % heads:
            raise ValueError(f"a width of {width} cannot be shared by {heads} heads")
        super().__init__(observation_space, 2 * width + OWN + _rays_of(observation_space))
        self.vehicle = nn.Linear(OWN, width)
        self.obstacle = nn.Sequential(nn.Linear(DISC, width), nn.SiLU(), nn.Linear(width, width))
        self.layers = nn.ModuleList([_Layer(width, heads) for _ in range(layers)])

    def forward(self, seen: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        own, rows, mask = _split(seen)
        tokens = torch.cat([self.vehicle(own)[:, None], self.obstacle(rows)], dim=1)
        present = torch.cat([torch.ones_like(mask[:, :1]), mask], dim=1) > 0.5
        for layer in self.layers:
            tokens = layer(tokens, present[:, None, None, :])
        away = mask[:, :, None] < 0.5
        best = tokens[:, 1:].masked_fill(away, -torch.inf).amax(dim=1)
        best = best.masked_fill(away.all(dim=1), 0.0)
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
        after: Tensor = tokens + self.then(tokens)
        return after


def _rays_of(space: spaces.Dict) -> int:
    """Numbers that `_rays` makes of rays.

    Raises:
        ValueError: no obstacles in the observation.
    """
    if "obstacles" not in space.spaces:
        raise ValueError(
            "a network of obstacles needs to see them: observation discs or both, not rays"
        )
    return 2 * spaces.flatdim(space["rays"]) if "rays" in space.spaces else 0


def _own(seen: dict[str, Tensor]) -> Tensor:
    """Goal and vehicle (n, 15), the goal on finer scales too."""
    distance, way = seen["goal"][:, :1], seen["goal"][:, 1:]
    finer = [(scale * distance).clamp(max=1.0) for scale in NEARER]
    nearer = [part for near in finer for part in (near, near * way)]
    return torch.cat([seen["goal"], seen["vehicle"], *nearer], dim=1)


def _split(seen: dict[str, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
    """The vehicle's own (n, size), obstacles (n, K, 7) and mask (n, K).

    An obstacle's row and, so that networks need not find out, its direction and how near its
    surface is, finest where it is near.
    """
    own = _own(seen)
    rows = seen["obstacles"].view(len(own), -1, 4)
    centre = rows[:, :, :2]
    way = centre / (centre.norm(dim=2, keepdim=True) + GRAIN)
    return own, torch.cat([rows, way, torch.exp(-FALL * rows[:, :, 3:])], dim=2), seen["mask"]


def _rays(seen: dict[str, Tensor]) -> list[Tensor]:
    """Ranges, and how near their ends are."""
    return [seen["rays"], torch.exp(-FALL * seen["rays"])] if "rays" in seen else []
