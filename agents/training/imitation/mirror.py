"""Mirror images of observations and actions: reflection in the diagonal of the field.

Start, goal, bounds and limits are the same on both sides of the line from (0, 0) to (100, 100), so
that the mirror image of a sample is a valid sample of another field.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

_SWAPPED = [1, 0, 3, 2, 4, 5]
"""Order of the entries of `vehicle`: x and y, and cosine and sine of the heading, change places."""


def mirrored(observations: dict[str, Tensor], actions: Tensor) -> tuple[dict[str, Tensor], Tensor]:
    """Mirror images of the environment's observations, entries (n, size), and of actions (n, 4)."""
    images: dict[str, Callable[[Tensor], Tensor]] = {
        "goal": lambda one: one * one.new_tensor([1.0, 1.0, -1.0]),
        "vehicle": lambda one: one[:, _SWAPPED],
        "obstacles": _mirrored_obstacles,
        # the first ray stays, the second one changes places with the last
        "rays": lambda one: torch.roll(one.flip(1), 1, 1),
        "mask": lambda one: one,
        "way": _mirrored_way,
    }
    flipped = actions * actions.new_tensor([1.0, -1.0, 1.0, -1.0])
    return {key: images[key](value) for key, value in observations.items()}, flipped


def mirrored_cores(obstacles: Tensor) -> Tensor:
    """Mirror images of obstacles (n, K, 2 C + 1) as `near_obstacles` gives them.

    Corners change their order, so that it is counter-clockwise again.
    """
    corners = obstacles[:, :, :-1].reshape(*obstacles.shape[:2], -1, 2).flip(2)
    images = corners * corners.new_tensor([1.0, -1.0])
    return torch.cat([images.flatten(2), obstacles[:, :, -1:]], dim=2)


def _mirrored_obstacles(obstacles: Tensor) -> Tensor:
    rows = obstacles.view(len(obstacles), -1, 4)
    return (rows * rows.new_tensor([1.0, -1.0, 1.0, 1.0])).flatten(1)


def _mirrored_way(way: Tensor) -> Tensor:
    points = way[:, :-2].view(len(way), -1, 2) * way.new_tensor([1.0, -1.0])
    return torch.cat([points.flatten(1), way[:, -2:]], dim=1)
