"""Feature extractors in torch: plain concatenation, and deep sets of obstacles.

Observations are divided by large lengths, so each extractor adds a rescaled copy of short
distances: a metre matters beside an obstacle and on the last segments before the goal.
`agents.models.inference.features` has compiled versions of both. The attribute names of layers are
the names of weights in saved models and must not change.
"""

from __future__ import annotations

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from agents.models.inference.features import (
    DIRECTION_OFFSET,
    DISC_SIZE,
    GOAL_SCALES,
    NEARNESS_DECAY,
    POOL_SCALE,
    VEHICLE_SIZE,
    WAY_SCALE,
    way_size,
)


class Plain(BaseFeaturesExtractor):
    """All entries of the observation concatenated, with all but obstacles on finer scales."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        sizes = {key: spaces.flatdim(box) for key, box in observation_space.spaces.items()}
        rows = sizes.get("mask", 0) + sizes.get("obstacles", 0)
        others = 2 * sizes.get("rays", 0) + way_size(sizes.get("way", 0))
        super().__init__(observation_space, VEHICLE_SIZE + rows + others)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        rows = [observation[key] for key in ("mask", "obstacles") if key in observation]
        return torch.cat([_own(observation), *rows, *_others(observation)], dim=1)


class DeepSets(BaseFeaturesExtractor):
    """One network applied to each obstacle, pooled by sum and maximum; other entries are appended.

    The features depend neither on the order of the obstacles nor on padding rows.

    Args:
        observation_space: dictionary space with `obstacles` and `mask`.
        width: width of the two layers.

    Raises:
        ValueError: The observation has no obstacles.

    Reference:
        Zaheer et al. (2017), Deep Sets, NeurIPS 30.
    """

    def __init__(self, observation_space: spaces.Dict, width: int = 64) -> None:
        super().__init__(
            observation_space, 2 * width + VEHICLE_SIZE + _others_of(observation_space)
        )
        self.obstacle = nn.Linear(DISC_SIZE, width)
        self.vehicle = nn.Linear(VEHICLE_SIZE, width, bias=False)
        self.then = nn.Linear(width, width)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Features (n, features_dim)."""
        own, rows, mask = _split(observation)
        # the first layer in two parts, so that the vehicle is not copied beside each obstacle
        first = torch.relu(self.obstacle(rows) + self.vehicle(own)[:, None])
        each = torch.relu(self.then(first)) * mask[:, :, None]
        # scaled so that the sum over a dozen obstacles is near one
        pooled = [each.sum(dim=1) / POOL_SCALE, each.amax(dim=1)]
        return torch.cat([*pooled, own, *_others(observation)], dim=1)


def _others_of(space: spaces.Dict) -> int:
    """Number of features of rays and way; raises ValueError if obstacles are not observed."""
    if "obstacles" not in space.spaces:
        raise ValueError("this policy needs obstacles in the observation: discs or both, not rays")
    sizes = {key: spaces.flatdim(box) for key, box in space.spaces.items()}
    return 2 * sizes.get("rays", 0) + way_size(sizes.get("way", 0))


def _own(observation: dict[str, Tensor]) -> Tensor:
    """Goal and vehicle (n, VEHICLE_SIZE), with the goal on finer scales as well."""
    distance, direction = observation["goal"][:, :1], observation["goal"][:, 1:]
    finer = [(scale * distance).clamp(max=1.0) for scale in GOAL_SCALES]
    nearer = [part for near in finer for part in (near, near * direction)]
    return torch.cat([observation["goal"], observation["vehicle"], *nearer], dim=1)


def _split(observation: dict[str, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
    """Vehicle features (n, VEHICLE_SIZE), obstacles (n, K, DISC_SIZE) and mask (n, K).

    An obstacle's row is extended by its unit direction and by the nearness of its surface, which
    decays exponentially with distance.
    """
    own = _own(observation)
    rows = observation["obstacles"].view(len(own), -1, 4)
    centre = rows[:, :, :2]
    direction = centre / (centre.norm(dim=2, keepdim=True) + DIRECTION_OFFSET)
    nearness = torch.exp(-NEARNESS_DECAY * rows[:, :, 3:])
    return own, torch.cat([rows, direction, nearness], dim=2), observation["mask"]


def _others(observation: dict[str, Tensor]) -> list[Tensor]:
    """Ranges of the rays and the nearness of their ends; the way; nothing of what is not observed.

    Points of the way are in multiples of their distance, so that all are of a size.
    """
    rays = [observation["rays"]] if "rays" in observation else []
    features = rays + [torch.exp(-NEARNESS_DECAY * ranges) for ranges in rays]
    if "way" in observation:
        way = observation["way"]
        points = way.shape[1] // 2 - 1
        nearer = points / torch.arange(1.0, points + 1.0, device=way.device)
        togo = (WAY_SCALE * way[:, -2:-1]).clamp(max=1.0)
        features += [way[:, :-2] * nearer.repeat_interleave(2), way[:, -2:], togo]
    return features
