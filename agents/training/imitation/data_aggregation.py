"""The growing dataset of DAgger: rollouts of each round, kept on disk and added to one dataset."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
from joblib import delayed
from torch import nn

from agents.demonstrations import Demonstrations
from agents.models.model_card import ModelCard
from agents.runtime.interrupts import raise_if_interrupted
from agents.runtime.worker_processes import map_in_processes
from agents.training.imitation import dagger_rollouts
from agents.training.imitation.dagger_rollouts import RolloutRequest, Rollouts
from agents.training.imitation.dataset import ImitationDataset
from agents.training.imitation.demonstration_data import labelled_rows
from agents.training.imitation.options import ImitationOptions
from agents.training.run import Run
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation.settings import settings_of

SHARES = 8
"""Requests that the rollouts of a round are split into, whatever the number of workers."""
MOST_FIELDS = 10_000_000
"""Number of fields reserved for each seed of a run."""
_ROWS = "rows-{:06d}.npy"


class DataAggregation:
    """The dataset of a run and the rounds of rollouts in it, whose rows a directory keeps."""

    def __init__(
        self, run: Run, card: ModelCard, options: ImitationOptions, directory: Path
    ) -> None:
        self._run, self._card, self._options, self._directory = run, card, options, directory
        settings = settings_of(run.environment(card))
        self.dataset, self._field = ImitationDataset(settings), settings.field
        self.rounds = 0
        """Rounds of rollouts in the dataset, those before the first update among them."""

    def add_demonstrations(self, demos: Demonstrations) -> None:
        """Add demonstrations.

        Raises:
            ValueError: a flight ends before its actions do, or there are no flights.
        """
        for number, (field, rows) in enumerate(labelled_rows(demos)):
            self.dataset.add_states(rows, {number: field}.__getitem__)
        if not len(self.dataset):
            raise ValueError(f"--demos {self._run.demos} holds no flights to learn from")

    def restore(self, rounds: int) -> None:
        """Add the first rounds from their files.

        Raises:
            OSError, ValueError: a file is missing or damaged.
        """
        for number in range(rounds):
            rows = np.load(self._directory / _ROWS.format(number), allow_pickle=False)
            self.dataset.add_states(rows, self._field)
        self.rounds = rounds

    def rollouts(
        self, policy: nn.Module, multiple: int = 1
    ) -> AbstractContextManager[Iterator[Rollouts]]:
        """Start the rollouts of a policy as it is now, in other processes if there are workers.

        Args:
            policy: with the networks of the card.
            multiple: rollouts in multiples of those of a round.
        """
        weights = {key: value.clone() for key, value in policy.state_dict().items()}
        requests = [
            RolloutRequest(
                card=self._card,
                environment=self._run.environment(self._card),
                weights=weights,
                expert=self._options.expert,
                seeds=seeds,
                stream=(self._run.seed, self.rounds, share),
                scattered=self._options.scattered,
                follows=self.rounds == 0,
            )
            for share, seeds in enumerate(self._seeds(multiple))
        ]
        calls = (delayed(dagger_rollouts.collect)(request) for request in requests)
        return map_in_processes(calls, self._run.workers, in_order=True, ahead=len(requests))

    def _seeds(self, multiple: int) -> list[range]:
        """Seeds of the next fields, a range for each request; no seed is flown twice."""
        per_round = self._run.hyperparameters.n_envs
        before = self._options.first - 1 if self.rounds else 0
        first = self._run.seed * MOST_FIELDS + per_round * (self.rounds + before)
        shares = SHARES * multiple
        cuts = [first + per_round * multiple * share // shares for share in range(shares + 1)]
        return [range(begin, end) for begin, end in itertools.pairwise(cuts)]

    def add(self, rollouts: Iterable[Rollouts]) -> tuple[int, int]:
        """Add a round of rollouts and keep its rows on disk.

        Returns:
            States visited, and segments of the learner that were refused.

        Raises:
            KeyboardInterrupt: Ctrl-C; nothing is added.
        """
        results = []
        for result in rollouts:
            raise_if_interrupted()
            results.append(result)
        rows = np.concatenate([result.rows for result in results])
        with atomic_write(self._directory / _ROWS.format(self.rounds)) as temporary:
            np.save(temporary, rows)
        for result in results:
            self.dataset.add(result.rows, result.columns)
        self.rounds += 1
        return sum(one.steps for one in results), sum(one.refused for one in results)
