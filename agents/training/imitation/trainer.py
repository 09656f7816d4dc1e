"""Behaviour cloning of demonstrations, and DAgger, as `ferguson train` runs them.

A round of DAgger is a number of gradient steps. Meanwhile the policy from the round's beginning
flies through new fields, and the expert labels the states that it visits. With a limit of steps,
the result therefore does not depend on the number of worker processes or on their speed; with a
limit of time, it depends on the number of rounds that fit into that time.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable, Iterator
from typing import cast

import numba
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from torch.utils.tensorboard import SummaryWriter

from agents.demonstrations import reading
from agents.models import networks
from agents.models.model_card import ModelCard
from agents.models.torch_model import TorchModel
from agents.runtime.interrupts import defer_interrupt, raise_if_interrupted
from agents.runtime.jobs import DONE, Job
from agents.training import run as training
from agents.training.budget import STOPPING, LinearSchedule, TrainingBudget
from agents.training.checkpoint import damaged
from agents.training.hyperparameters import slope
from agents.training.imitation.behavior_cloning import BehaviorCloning
from agents.training.imitation.dagger_rollouts import Rollouts
from agents.training.imitation.data_aggregation import MOST_FIELDS, SHARES, DataAggregation
from agents.training.imitation.options import WAY_EXPERT, ImitationOptions
from agents.training.learning_curve import TrainingRecord
from agents.training.progress import TrainingProgress, show_progress, write_progress
from agents.training.run import Run, fields_named
from agents.training.sb3 import card_for, starting_model
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.runtime.atomic_files import atomic_write
from planners.interface import Replanner
from planners.registry import make

_MOST_SEED = 2**53 // MOST_FIELDS - 1
"""Maximum seed of a run: seeds of fields follow from it, which rows hold in double precision."""
_LAST_RATE = 0.02
"""Minimum learning rate at the end of a linear schedule, as a share of the first."""
_STATE = "state.pt"


def prepare(run: Run) -> Job:
    """Check a run and return the job that trains; see `agents.training.run.Trainer`."""
    start = None if run.start is None else starting_model(run)
    card = card_for(run, start)
    for spec in (run.chosen_on, run.reported_on):
        fields_named(spec)
    if run.algorithm == "bc" and run.demos is None:
        raise ValueError("bc learns from demonstrations: name them with --demos DATASET_ID")
    if run.algorithm == "bc" and run.fields:
        raise ValueError("bc flies no fields, it learns from --demos; leave --fields out")
    demos = None if run.demos is None else reading.read(run.demos)
    trainer = ImitationTrainer(run, card, start)
    numba.set_num_threads(min(run.threads, numba.get_num_threads()))
    torch.set_num_threads(run.threads)  # after Numba has started its threads and set OpenMP's
    if demos is not None:  # before the rollouts, also where a training resumes
        trainer.data.add_demonstrations(demos)
    resumed = not run.fresh and trainer.restore()
    record = TrainingRecord(run, card, trainer.budget.steps) if resumed else None

    def job() -> int:
        if record is None:
            training.delete_run(run.directory)
            training.begin(run)
        trainer.train(record or TrainingRecord(run, card))
        shutil.rmtree(trainer.directory)
        return DONE

    return job


class ImitationTrainer:
    """Rounds of gradient steps and, for DAgger, of rollouts; `start` gives the initial weights.

    Raises:
        ValueError: hyperparameters out of their range, or an expert that cannot label states.
    """

    def __init__(self, run: Run, card: ModelCard, start: TorchModel | None = None) -> None:
        self._run = run
        self._options = _options(run)
        self.budget = TrainingBudget(run.most_steps, run.minutes)
        self._seconds_before = 0.0
        self.directory = run.directory / "checkpoint"
        self.data = DataAggregation(run, card, self._options, self.directory)
        # the networks of PPO, so that PPO can refine the model; it does not train them here
        self._model = PPO(
            cast(type[ActorCriticPolicy], networks.policy_class(run.algorithm, card.policy)),
            ObstacleFieldVecEnv(1, **card.environment),
            n_steps=2,
            batch_size=2,
            seed=run.seed,
            device="cpu",
            policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
        )
        if start is not None:
            self._model.policy.load_state_dict(start.policy.state_dict())
        first = slope(rate := self._options.learning_rate)
        value, least = (float(rate), 1.0) if first is None else (first, _LAST_RATE)
        schedule = LinearSchedule(value, self.budget, least)
        self._cloning = BehaviorCloning(self._model.policy, schedule, self._options.violation)

    def restore(self) -> bool:
        """Resume from the run's checkpoint; False if there is none.

        Raises:
            ValueError: the checkpoint is damaged.
        """
        file = self.directory / _STATE
        if not file.is_file():
            return False
        try:
            state = torch.load(file, map_location="cpu", weights_only=True)
            self._cloning.restore(state["cloner"])
            self.budget.steps, seconds = int(state["steps"]), float(state["seconds"])
            if self.budget.steps < 0 or not 0.0 <= seconds < math.inf:
                raise ValueError(f"{self.budget.steps} steps in {seconds} s")
            self.data.restore(int(state["rounds"]))
        except Exception as error:  # the libraries raise errors of many types on a damaged file
            raise damaged(self.directory, error) from None
        self._seconds_before = seconds
        self.budget.start(seconds)
        return True

    def _save(self) -> None:
        """Write a checkpoint; the rows of each round are in files of their own."""
        state = {
            "cloner": self._cloning.state(),
            "rounds": self.data.rounds,
            "steps": self.budget.steps,
            "seconds": self.budget.seconds,
        }
        with atomic_write(self.directory / _STATE) as temporary:
            torch.save(state, temporary)

    def train(self, record: TrainingRecord) -> None:
        """Train until a limit is reached, evaluate on the way, and write the best model.

        A round that Ctrl-C cuts short is repeated from its beginning when the training resumes, so
        that the final model does not depend on interruptions.

        Raises:
            KeyboardInterrupt: Ctrl-C; the checkpoint holds all rounds that are complete.
        """
        self.directory.mkdir(parents=True, exist_ok=True)
        self.budget.start(self._seconds_before)
        with (
            show_progress(self._run, record, self.budget) as progress,
            SummaryWriter(str(self._run.directory / "tensorboard")) as writer,
            defer_interrupt(STOPPING),
        ):
            # at least one round, even if interruptions in the first have used up the time
            while self.budget.done < 1.0 or not record.curve:
                for name, value in self._round(progress).items():
                    writer.add_scalar(f"train/{name}", value, self.budget.steps)
                curve = record.curve
                due = self._run.hyperparameters.eval_freq + (curve[-1]["steps"] if curve else 0)
                if self.budget.steps >= due or not curve:
                    self._evaluate(record)
                self._save()
                raise_if_interrupted()
            if record.curve[-1]["steps"] < self.budget.steps:
                self._evaluate(record)
        record.finish()
        write_progress(self._run, record, self.budget, "finished")

    def _evaluate(self, record: TrainingRecord) -> None:
        record.evaluate(self._model, self.budget.steps, self.budget.seconds)

    def _round(self, progress: TrainingProgress) -> dict[str, float]:
        """Train for a round while its rollouts are collected; returns mean losses by name."""
        if self._run.algorithm == "bc":
            losses = self._optimize(progress)
            self.budget.steps += self._options.updates * self._options.batch_size
            return losses
        if self.data.rounds == 0:
            first = self._options.first
            with self.data.rollouts(self._model.policy, first) as rollouts:
                self._collect(rollouts, progress, "first flights", SHARES * first)
            self._save()
        with self.data.rollouts(self._model.policy) as rollouts:
            losses = self._optimize(progress)
            return {**losses, "refused": self._collect(rollouts, progress, "flights", SHARES)}

    def _collect(
        self, rollouts: Iterable[Rollouts], progress: TrainingProgress, title: str, number: int
    ) -> float:
        """Add this number of rollouts; returns the share of segments that were refused."""

        def watched() -> Iterator[Rollouts]:
            for done, result in enumerate(rollouts, 1):
                yield result
                progress.update(f"{title} {done / number:.0%}")

        steps, refused = self.data.add(watched())
        self.budget.steps += steps
        return refused / max(steps, 1)

    def _optimize(self, progress: TrainingProgress) -> dict[str, float]:
        """The gradient steps of a round; returns mean losses by name."""
        options = self._options
        stream = np.random.default_rng((self._run.seed, self.data.rounds, self.budget.steps))
        losses: list[dict[str, float]] = []
        for number in range(options.updates):
            batch = self.data.dataset.sample(stream, options.batch_size, options.hard)
            losses.append(self._cloning.update(batch, mirror=number % 2 == 1))
            progress.update()
            raise_if_interrupted()
        return {key: float(np.mean([loss[key] for loss in losses])) for key in losses[0]}


def _options(run: Run) -> ImitationOptions:
    if run.seed > _MOST_SEED:
        raise ValueError(f"{run.algorithm} takes seeds up to {_MOST_SEED}, got {run.seed}")
    options = ImitationOptions(**run.hyperparameters.learner)
    if options.expert != WAY_EXPERT and not isinstance(make(str(options.expert)), Replanner):
        raise ValueError(
            f"expert {options.expert!r} plans its whole path at once; one that decides step by "
            "step can be asked anywhere: pursuit or guided, for example"
        )
    return options
