"""Lessons: states of flights, what is seen there, and what an expert would do."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.field import Field
from ferguson_gym.world.transition import State

COLUMNS = 11
"""Of a row: the seed of the field (or another number for it), position and derivative (2 each),
segments flown, action (4), whether a failure is near."""
RECENT = 30_000
"""Lessons near failures that are drawn more often: the last ones, of what is not yet learned."""
_AROUND = Settings(nearest=12, focus=8.0)
"""The discs that an action can cut into, whatever the learner sees."""
_FIRST = 4096
"""Rows that there is room for at first; it doubles when it is used up."""


class ImitationSample(NamedTuple):
    """Some lessons at once."""

    seen: dict[str, Tensor]
    """Entries (n, size)."""
    actions: Tensor
    """(n, 4) the expert's."""
    discs: Tensor
    """(n, K, 3) around the vehicle: centre in its frame and radius [m]."""
    present: Tensor
    """(n, K) 1 for a disc, 0 for padding."""


def row(seed: int, vehicle: State, action: NDArray[np.float32]) -> list[float]:
    """A lesson as a row of `COLUMNS` numbers, with no failure near."""
    return [seed, *vehicle.position, *vehicle.derivative, vehicle.segments, *action, 0.0]


class ImitationDataset:
    """All lessons so far, as a learner with these settings sees them."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._parts: dict[str, NDArray[np.float32]] = {}
        self._number = 0
        self._hard = np.empty(0, np.int64)

    def __len__(self) -> int:
        return self._number

    def add(self, rows: Array, field_of: Callable[[int], Field]) -> None:
        """Take in rows (n, COLUMNS); those of one field stand together.

        Args:
            rows: as `row` makes them.
            field_of: the field of a seed.
        """
        near = self._number + np.flatnonzero(rows[:, 10] > 0.0)
        self._hard = np.concatenate([self._hard, near])[-RECENT:]
        cuts = np.flatnonzero(np.diff(rows[:, 0])) + 1
        for part in np.split(rows, cuts) if len(rows) else []:
            field = field_of(int(part[0, 0]))
            vehicles = [State(one[1:3], one[3:5], int(one[5])) for one in part]
            around = observe(field, vehicles, _AROUND)
            self._put(
                {
                    **observe(field, vehicles, self._settings),
                    "_discs": _AROUND.view * _columns(around["obstacles"]),
                    "_present": around["mask"],
                    "_actions": part[:, 6:10].astype(np.float32),
                }
            )

    def _put(self, columns: dict[str, NDArray[np.float32]]) -> None:
        number = len(columns["_actions"])
        if not self._parts:
            self._parts = {
                key: np.empty((_FIRST, value.shape[1]), np.float32)
                for key, value in columns.items()
            }
        while self._number + number > len(self._parts["_actions"]):
            self._parts = {
                key: np.concatenate([value, np.empty_like(value)])
                for key, value in self._parts.items()
            }
        for key, value in columns.items():
            self._parts[key][self._number : self._number + number] = value
        self._number += number

    def draw(self, stream: np.random.Generator, number: int, hard: float) -> ImitationSample:
        """So many lessons at random, a share of them near failures if there are any."""
        which = stream.integers(0, self._number, number)
        if len(self._hard):
            again = int(hard * number)
            which[:again] = self._hard[stream.integers(0, len(self._hard), again)]
        drawn = {key: torch.from_numpy(value[which]) for key, value in self._parts.items()}
        return ImitationSample(
            {key: value for key, value in drawn.items() if not key.startswith("_")},
            drawn["_actions"],
            drawn["_discs"].view(number, -1, 3),
            drawn["_present"],
        )


def _columns(obstacles: NDArray[np.float32]) -> NDArray[np.float32]:
    """Centre and radius (n, 3 K) out of rows of four."""
    rows = obstacles.reshape(len(obstacles), -1, 4)[:, :, :3]
    return np.ascontiguousarray(rows.reshape(len(obstacles), -1))
