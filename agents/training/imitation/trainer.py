"""Imitation: behaviour cloning of demonstrations, and DAgger, which asks an expert on the way.

A round of DAgger is a number of updates; meanwhile the policy as it was at its beginning flies
through new fields, and the expert says what it would have done. So it does not matter how many
processes fly, nor which is faster.

Reference:
    Ross, Gordon & Bagnell (2011), A reduction of imitation learning and structured prediction to
    no-regret online learning, AISTATS.
"""

from __future__ import annotations

import itertools
import math
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, cast

import numba
import numpy as np
import torch
from joblib import delayed
from rich.progress import Progress
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from torch.utils.tensorboard import SummaryWriter

from agents.models import networks
from agents.models.model_card import ModelCard
from agents.models.torch_model import TorchModel
from agents.runtime.executors import map_in_processes
from agents.runtime.interrupts import Interrupt, defer_interrupt, raise_if_interrupted
from agents.runtime.jobs import DONE, Job
from agents.training import run as training
from agents.training.budget import STOPPING, TrainingBudget
from agents.training.hyperparameters import slope
from agents.training.imitation import dagger_rollouts, demonstration_data
from agents.training.imitation.behavior_cloning import BehaviorCloning
from agents.training.imitation.dagger_rollouts import Visit, Visited
from agents.training.imitation.dataset import ImitationDataset
from agents.training.learning_curve import Record
from agents.training.run import Run
from agents.training.sb3 import card_for, starting_model
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world.field_names import get_fields
from planners.interface import Replanner
from planners.registry import make

SETTINGS: dict[str, Any] = {
    "expert": "pursuit",
    "scattered": 0.3,
    "first": 10,
    "updates": 400,
    "batch_size": 512,
    "hard": 0.25,
    "learning_rate": 1e-3,
    "violation": 8.0,
}
"""The learner's keys in a recipe, and their values where it is silent: who is asked, the share of
flights that begin anywhere, how many rounds' flights are watched before the first update, updates
of a round, lessons of an update, the share of them near failures, its rate, and the price of a
metre of violation. A round flies `n_envs` flights; `n_timesteps` and `eval_freq` count states that
the expert was asked about (`dagger`) or lessons that were learned from (`bc`)."""
_SHARES = 8
"""That a round's flights are handed out in."""
_FIELDS = 10_000_000
"""Fields from those of one seed to those of the next."""
_MOST_SEED = 2**32 - 1
"""Of a run: so that fields have seeds, and what draws the first weights takes it."""
_STATE = "state.pt"
_ROWS = "rows-{:06d}.npy"


def prepare(run: Run) -> Job:
    """See `agents.training.run.Trainer`."""
    start = None if run.start is None else starting_model(run)
    card = card_for(run, start)
    for spec in (run.chosen_on, run.reported_on):
        get_fields(spec)
    if run.algorithm == "bc" and run.demos is None:
        raise ValueError("bc learns from demonstrations: name them with --demos DATASET_ID")
    demos = None if run.demos is None else demonstration_data.read(run.demos)
    school = _School(run, card)
    numba.set_num_threads(min(run.threads, numba.get_num_threads()))
    torch.set_num_threads(run.threads)  # after Numba has started its threads and set OpenMP's
    if start is not None:
        school.begin_with(start)
    if demos is not None:  # before what came later, however often the training is taken up
        school.take_in(demos)
    known = None
    if not run.fresh and school.restore():
        known = Record(run, card, school.pace.steps)

    def job() -> int:
        if known is None:
            training.delete_run(run.directory)
            training.begin(run)
        school.teach(known or Record(run, card, school.pace.steps))
        shutil.rmtree(run.directory / "checkpoint")
        return DONE

    return job


class _School:
    """A learner, its lessons, and how far it is."""

    def __init__(self, run: Run, card: ModelCard) -> None:
        """A learner that knows nothing.

        Raises:
            ValueError: hyperparameters that make no sense.
        """
        self._run, self._card = run, card
        self._told = {**SETTINGS, **run.recipe.learner}
        self._check()
        self.pace = TrainingBudget(run.most_steps, run.minutes)
        settings = settings_of(card.environment)
        self._lessons, self._field = ImitationDataset(settings), settings.field
        # PPO's networks, so that it can go on with them; none of its own learning is used here
        self._shell = PPO(
            cast(type[ActorCriticPolicy], networks.policy_class(run.algorithm, card.policy)),
            ObstacleFieldVecEnv(1, **card.environment),
            n_steps=2,
            batch_size=2,
            seed=run.seed,
            device="cpu",
            policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
        )
        self._cloner = self._new_cloner()
        self._rounds, self._before = 0, 0.0

    def _check(self) -> None:
        told = self._told
        if self._run.seed > _MOST_SEED:
            raise ValueError(
                f"{self._run.algorithm} takes seeds up to {_MOST_SEED}, got {self._run.seed}"
            )
        for key in ("updates", "batch_size", "first"):
            if type(told[key]) is not int or told[key] < 1:
                raise ValueError(f"{key} must be a whole number from 1 on, got {told[key]!r}")
        for key, most in (("scattered", 1.0), ("hard", 1.0), ("violation", 1e6)):
            if type(told[key]) not in (int, float) or not 0.0 <= told[key] <= most:
                raise ValueError(f"{key} must lie between 0 and {most:g}, got {told[key]!r}")
        rate = told["learning_rate"]
        rate = rate if slope(rate) is None else slope(rate)
        if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0.0 < rate < 1.0:
            raise ValueError(
                f"learning_rate must lie between 0 and 1, got {told['learning_rate']!r}"
            )
        if not isinstance(make(str(told["expert"])), Replanner):
            raise ValueError(
                f"expert {told['expert']!r} plans its whole path at once; one that decides step by "
                "step can be asked anywhere: pursuit or guided, for example"
            )

    def _new_cloner(self) -> BehaviorCloning:
        given = self._told["learning_rate"]
        top = slope(given)

        def rate() -> float:
            # a little is left at the end: what comes last should not be wasted
            return given if top is None else top * max(1.0 - self.pace.done, 0.02)

        return BehaviorCloning(self._shell.policy, rate, self._told["violation"])

    def begin_with(self, start: TorchModel) -> None:
        """Know what a model knows."""
        self._shell.policy.load_state_dict(start.policy.state_dict())
        self._cloner = self._new_cloner()

    @property
    def _place(self) -> Path:
        return self._run.directory / "checkpoint"

    def restore(self) -> bool:
        """Go on from the run's checkpoint, if there is one.

        Raises:
            ValueError: it is damaged.
        """
        file = self._place / _STATE
        if not file.is_file():
            return False
        try:
            state = torch.load(file, map_location="cpu", weights_only=True)
            self._cloner.restore(state["cloner"])
            self._rounds, steps = int(state["rounds"]), int(state["steps"])
            self._before = float(state["seconds"])
            if steps < 0 or not 0.0 <= self._before < math.inf:
                raise ValueError(f"{steps} steps in {self._before} s")
            for number in range(self._rounds):
                rows = np.load(self._place / _ROWS.format(number), allow_pickle=False)
                self._lessons.add(rows, self._field)
        except Exception as error:  # of whatever the libraries make of a damaged file
            reason = " ".join(str(error).split())[:120]
            raise ValueError(
                f"the checkpoint {self._place} cannot be read ({reason}); --fresh starts over"
            ) from None
        self.pace = TrainingBudget(self._run.most_steps, self._run.minutes, steps, self._before)
        return True

    def _keep(self) -> None:
        """Write a checkpoint; the lessons of each round are there already."""
        state = {
            "cloner": self._cloner.state(),
            "rounds": self._rounds,
            "steps": self.pace.steps,
            "seconds": self.pace.seconds,
        }
        with atomic_write(self._place / _STATE) as temporary:
            torch.save(state, temporary)

    def take_in(self, demos: demonstration_data.Demonstrations) -> None:
        """Learn from demonstrations too.

        Raises:
            ValueError: they are not of this environment, or there are none.
        """
        for number, (field, rows) in enumerate(demonstration_data.rows(demos)):
            self._lessons.add(rows, {number: field}.__getitem__)
        if not len(self._lessons):
            raise ValueError(f"--demos {self._run.demos} holds no flights to learn from")

    def teach(self, record: Record) -> None:
        """Rounds, until a limit is reached; then the best model is the final one.

        Raises:
            KeyboardInterrupt: Ctrl-C; the checkpoint has all rounds that are over.
        """
        self._place.mkdir(parents=True, exist_ok=True)
        self.pace.start(self._before)
        with (
            SummaryWriter(str(self._run.directory / "tensorboard")) as writer,
            defer_interrupt(STOPPING) as interrupt,
            self._run.terminal.share_bar() as bar,
        ):
            # one round at least: a run interrupted in the first may have used up its time
            while not interrupt.pressed and (self.pace.done < 1.0 or not record.curve):
                costs = self._round(interrupt, bar)
                if costs is None:
                    break
                for name, value in costs.items():
                    writer.add_scalar(f"train/{name}", value, self.pace.steps)
                curve = record.curve
                due = self._run.recipe.eval_freq + (curve[-1]["steps"] if curve else 0)
                if self.pace.steps >= due or not curve:
                    record.consider(self._shell, self.pace.steps, self.pace.seconds)
                self._keep()
            raise_if_interrupted()
            if record.curve[-1]["steps"] < self.pace.steps:
                record.consider(self._shell, self.pace.steps, self.pace.seconds)
        record.finish()

    def _round(self, interrupt: Interrupt, bar: Progress) -> dict[str, float] | None:
        """Updates, while flights go on whose lessons the next round has; what updates cost.

        None if it is cut short: then it is for the next sitting, from its beginning, so that a
        training ends with the same model however often it is interrupted.
        """
        if self._run.algorithm == "bc":
            if (costs := self._update(interrupt, bar)) is None:
                return None
            self.pace.steps += self._told["updates"] * self._told["batch_size"]
            return costs
        if self._rounds == 0:
            with self._fly(self._visits(self._told["first"])) as first:
                if self._learn_from(first, interrupt, bar, "first flights") is None:
                    return None
            self._keep()
        with self._fly(self._visits(1)) as going_on:
            costs = self._update(interrupt, bar)
            if costs is None:
                return None
            refused = self._learn_from(going_on, interrupt, bar, "flights")
        return None if refused is None else {**costs, "refused": refused}

    def _fly(self, asked: list[Visit]) -> AbstractContextManager[Iterator[Visited]]:
        """Start flights, in other processes if there are several workers."""
        calls = (delayed(dagger_rollouts.visit)(one) for one in asked)
        return map_in_processes(calls, self._run.workers, in_order=True, ahead=len(asked))

    def _visits(self, rounds: int) -> list[Visit]:
        """Flights of so many rounds, by the policy as it is now."""
        run, number = self._run, self._run.recipe.n_envs * rounds
        first = run.seed * _FIELDS + self._flown()
        shares = _SHARES * rounds
        cuts = [first + number * share // shares for share in range(shares + 1)]
        weights = {key: value.clone() for key, value in self._shell.policy.state_dict().items()}
        return [
            Visit(
                card=self._card,
                weights=weights,
                expert=self._told["expert"],
                seeds=range(begin, end),
                stream=(run.seed, self._rounds, share),
                scattered=self._told["scattered"],
            )
            for share, (begin, end) in enumerate(itertools.pairwise(cuts))
        ]

    def _flown(self) -> int:
        """Flights of all rounds so far."""
        before = self._told["first"] - 1 if self._rounds else 0
        flown: int = self._run.recipe.n_envs * (self._rounds + before)
        return flown

    def _learn_from(
        self, visited: Iterator[Visited], interrupt: Interrupt, bar: Progress, what: str
    ) -> float | None:
        """Take the lessons of flights in, and keep them.

        Returns:
            The share of steps that were refused; None, and nothing is taken in, if it is to stop.
        """
        rows: list[Array] = []
        steps = refused = 0
        task = bar.add_task(what, total=None)
        for one in visited:
            if interrupt.pressed:
                break
            rows.append(one.rows)
            steps, refused = steps + one.steps, refused + one.failures
        bar.remove_task(task)
        if interrupt.pressed:
            return None
        every = np.concatenate(rows)
        with atomic_write(self._place / _ROWS.format(self._rounds)) as temporary:
            np.save(temporary, every)
        self._lessons.add(every, self._field)
        self._rounds += 1
        self.pace.steps += steps
        return refused / max(steps, 1)

    def _update(self, interrupt: Interrupt, bar: Progress) -> dict[str, float] | None:
        """The updates of a round; None if it is to stop before they are done."""
        stream = np.random.default_rng((self._run.seed, self._rounds, self.pace.steps))
        task = bar.add_task(f"{self._run.algorithm}, {self.pace.steps:,} states", total=1.0)
        costs: list[dict[str, float]] = []
        for number in range(self._told["updates"]):
            lesson = self._lessons.draw(stream, self._told["batch_size"], self._told["hard"])
            costs.append(self._cloner.update(lesson, in_the_mirror=number % 2 == 1))
            bar.update(task, completed=self.pace.done)
            if interrupt.pressed:
                break
        bar.remove_task(task)
        if interrupt.pressed:
            return None
        return {key: float(np.mean([cost[key] for cost in costs])) for key in costs[0]}
