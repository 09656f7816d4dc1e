"""The mirror image of what is seen and flown: the world reflected in its diagonal.

Start, goal, bounds and the rules of flight are the same on both sides of the line from (0, 0) to
(100, 100), so that every lesson is two.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

_SWAPPED = [1, 0, 3, 2, 4, 5]
"""Entries of `vehicle`: x and y, cosine and sine of the heading change places."""


def mirrored(seen: dict[str, Tensor], actions: Tensor) -> tuple[dict[str, Tensor], Tensor]:
    """Observations and actions as they are in the mirror, for fields symmetric but for obstacles.

    Args:
        seen: entries (n, size), as the environment's docstring has them.
        actions: (n, 4).
    """
    images: dict[str, Callable[[Tensor], Tensor]] = {
        "goal": lambda one: one * one.new_tensor([1.0, 1.0, -1.0]),
        "vehicle": lambda one: one[:, _SWAPPED],
        "obstacles": _rows,
        # the first ray stays, the second one changes with the last
        "rays": lambda one: torch.roll(one.flip(1), 1, 1),
        "mask": lambda one: one,
    }
    flipped = actions * actions.new_tensor([1.0, -1.0, 1.0, -1.0])
    return {key: images[key](value) for key, value in seen.items()}, flipped


def _rows(obstacles: Tensor) -> Tensor:
    rows = obstacles.view(len(obstacles), -1, 4)
    return (rows * rows.new_tensor([1.0, -1.0, 1.0, 1.0])).flatten(1)
