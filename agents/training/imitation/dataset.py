"""The dataset of imitation: states of flights, their observations, and the expert's actions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.training.imitation.near_obstacles import NUMBER, near_obstacles, widened
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation import Settings, SimulatedRollouts
from ferguson_gym.world import Action, Field, State
from ferguson_gym.world.limits import PAPER_LONGEST

COLUMNS = 11
"""Columns of a row: seed of the field (or another number that stands for it), position and
derivative (2 each), segments flown, action (4), and 1 near a refused segment, else 0."""
RECENT = 30_000
"""Samples near refused segments that are oversampled: the most recent ones."""
_FIRST = 4096
"""Initial capacity in rows; it doubles when it is used up."""


class ImitationSample(NamedTuple):
    """A batch of n samples."""

    observations: dict[str, Tensor]
    """Entries (n, size)."""
    actions: Tensor
    """(n, 4) the expert's."""
    goal: Tensor
    """(n, 2) in the vehicle's frame [units of the field]."""
    obstacles: Tensor
    """(n, K, 2 C + 1) around the vehicle, as `near_obstacles` says; (n, K, 3) for discs."""
    present: Tensor
    """(n, K) 1 for an obstacle, 0 for padding."""


Columns: TypeAlias = dict[str, NDArray[np.float32]]
"""What samples hold of n states, by name (n, size): entries of observations, and `_actions`,
`_goal`, `_obstacles` and `_present`."""


def observed(rollouts: SimulatedRollouts, actions: Action) -> Columns:
    """What samples hold of the states of active rollouts, with an expert's actions (n, 4)."""
    obstacles, present = near_obstacles(rollouts.buffers)
    flights, fields = rollouts.buffers.flights, rollouts.buffers.fields.records
    own, along = fields[flights["slot"]], flights["derivative"]
    away = (own["goal"] - flights["position"]) * (PAPER_LONGEST / own["longest"])[:, None]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    goal = np.stack([(away * along).sum(axis=1), (away * left).sum(axis=1)], axis=1)
    return {
        **{key: value.copy() for key, value in rollouts.observations.items()},
        "_obstacles": obstacles.reshape(len(actions), -1),
        "_present": present,
        "_goal": goal.astype(np.float32),
        "_actions": actions,
    }


def labelled_row(seed: int, vehicle: State, action: NDArray[np.float32]) -> list[float]:
    """A state and the expert's action as a row of `COLUMNS` numbers, not near a refusal."""
    return [seed, *vehicle.position, *vehicle.derivative, vehicle.segments, *action, 0.0]


class ImitationDataset:
    """A growing dataset in memory, with a learner's observations in an environment's settings."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._columns: Columns = {}
        self._size = 0
        self._hard = np.empty(0, np.int64)

    def __len__(self) -> int:
        return self._size

    def add(self, rows: Array, columns: Columns) -> None:
        """Add samples.

        Args:
            rows: (n, COLUMNS) as `labelled_row` makes them.
            columns: what samples hold of these rows.
        """
        if not len(rows):
            return
        hard = self._size + np.flatnonzero(rows[:, 10] > 0.0)
        self._hard = np.concatenate([self._hard, hard])[-RECENT:]
        self._append(columns)

    def add_states(self, rows: Array, field_of: Callable[[int], Field]) -> None:
        """Observe the states of rows and add them.

        Args:
            rows: (n, COLUMNS) as `labelled_row` makes them; those of one field are adjacent.
            field_of: returns the field of a seed.
        """
        cuts = np.flatnonzero(np.diff(rows[:, 0])) + 1
        for part in np.split(rows, cuts) if len(rows) else []:
            field = field_of(int(part[0, 0]))
            vehicles = [State(row[1:3], row[3:5], int(row[5])) for row in part]
            nowhere_else = np.zeros(len(part), np.int64)
            flights = SimulatedRollouts([field], nowhere_else, vehicles, self._settings)
            self.add(part, observed(flights, part[:, 6:10].astype(np.float32)))

    def _append(self, columns: Columns) -> None:
        number = len(columns["_actions"])
        columns = self._alike(columns)
        if not self._columns:
            self._columns = {
                key: np.empty((_FIRST, value.shape[1]), np.float32)
                for key, value in columns.items()
            }
        while self._size + number > len(self._columns["_actions"]):
            self._columns = {
                key: np.concatenate([value, np.empty_like(value)])
                for key, value in self._columns.items()
            }
        for key, value in columns.items():
            self._columns[key][self._size : self._size + number] = value
        self._size += number

    def _alike(self, columns: Columns) -> Columns:
        """Columns with rows of obstacles as wide as those here, which are widened if need be."""
        rows = columns["_obstacles"].reshape(len(columns["_actions"]), NUMBER, -1)
        here = self._columns.get("_obstacles")
        if here is None or here.shape[1] == columns["_obstacles"].shape[1]:
            return columns
        old = here.reshape(len(here), NUMBER, -1)
        corners = max(old.shape[2], rows.shape[2]) // 2
        self._columns["_obstacles"] = widened(old, corners).reshape(len(here), -1)
        return {**columns, "_obstacles": widened(rows, corners).reshape(len(rows), -1)}

    def sample(self, stream: np.random.Generator, number: int, hard: float) -> ImitationSample:
        """Draw samples uniformly, a share of them from those near refused segments if any are."""
        which = stream.integers(0, self._size, number)
        if len(self._hard):
            again = int(hard * number)
            which[:again] = self._hard[stream.integers(0, len(self._hard), again)]
        drawn = {key: torch.from_numpy(value[which]) for key, value in self._columns.items()}
        return ImitationSample(
            {key: value for key, value in drawn.items() if not key.startswith("_")},
            drawn["_actions"],
            drawn["_goal"],
            drawn["_obstacles"].view(number, NUMBER, -1),
            drawn["_present"],
        )
