"""Reinforcement learning by Stable-Baselines3: PPO and TQC."""

from __future__ import annotations

import math
import shutil
import time
from typing import Any

import numba
import numpy as np
import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecMonitor

from agents.demonstrations import reading
from agents.models import networks, torch_model
from agents.models.architecture import MIXTURE, ON_POLICY
from agents.models.model_card import ModelCard, check_environment
from agents.models.torch_model import TorchModel
from agents.runtime.interrupts import Interrupt, defer_interrupt
from agents.runtime.jobs import DONE, Job
from agents.training import checkpoint as training_checkpoint
from agents.training import run as training
from agents.training.budget import STOPPING, LinearSchedule, TrainingBudget
from agents.training.hyperparameters import slope
from agents.training.imitation import demonstration_data
from agents.training.learning_curve import TrainingRecord, card_of
from agents.training.progress import TrainingProgress, show_progress, write_progress
from agents.training.run import Run, fields_named
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.simulation.settings import OBSERVING

CHECKPOINT_SECONDS = 300.0
"""Time between checkpoints [s]; one more is written when a training stops."""
_ENDLESS = 10**15
"""Limit of steps if only time is limited."""
_LOGGED_ROLLOUTS, _LOGGED_EPISODES = 1, 100
"""Logging interval of the library, which counts rollouts on policy and episodes off policy."""
_LEARNERS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "tqc": TQC}
_CRITIC_ALONE, _LAST_STD = "critic_alone", "last_std"
"""Keys of PPO that its library does not have: steps in which only the critic is trained, and the
standard deviation of the actions' noise at the end, to which it decreases from that of
`log_std_init` by the same factor in every step. A noise that is learned stays so large that flights
collide because of it alone."""
_CRITIC = ("mlp_extractor.value_net", "value_net")


def prepare(run: Run) -> Job:
    """Check a run and return the job that trains; see `agents.training.run.Trainer`."""
    start = None if run.start is None else starting_model(run)
    card = card_for(run, start)
    demos = None if run.demos is None else reading.read(run.demos)
    for spec in (run.chosen_on, run.reported_on):
        fields_named(spec)
    place = run.directory / "checkpoint"
    checkpoint = None if run.fresh else training_checkpoint.latest(place)
    counts = None if checkpoint is None else training_checkpoint.counts_of(checkpoint)
    steps, seconds = (0, 0.0) if counts is None else (counts.steps, counts.seconds)
    budget = TrainingBudget(run.most_steps, run.minutes, steps, seconds)
    _check_noise(run, card)
    numba.set_num_threads(min(run.threads, numba.get_num_threads()))
    torch.set_num_threads(run.threads)  # after Numba has started its threads and set OpenMP's
    model = _learner(run, card, budget)
    known = None
    if checkpoint is not None:
        training_checkpoint.restore(checkpoint, model)
        known = TrainingRecord(run, card, steps)
    else:
        if start is not None:
            model.policy.load_state_dict(start.policy.state_dict())
        if demos is not None:
            buffer: Any = model.replay_buffer  # type: ignore[attr-defined]
            demonstration_data.fill(buffer, demos, card.environment)

    def job() -> int:
        if known is None:
            training.delete_run(run.directory)  # without a checkpoint nothing can resume
            training.begin(run)
        record = known or TrainingRecord(run, card)
        budget.start(seconds)
        _learn(run, model, record, budget)
        record.finish()
        write_progress(run, record, budget, "finished")
        shutil.rmtree(place)
        return DONE

    return job


def _check_noise(run: Run, card: ModelCard) -> None:
    last = run.hyperparameters.learner.get(_LAST_STD)
    if last is None:
        return
    if isinstance(last, bool) or not isinstance(last, (int, float)) or not 0.0 < last <= 1.0:
        raise ValueError(f"{_LAST_STD} must lie between 0 and 1, got {last!r}")
    if card.policy.endswith(MIXTURE):
        raise ValueError(f"{card.policy} learns its noise in each state: leave {_LAST_STD} out")


def starting_model(run: Run) -> TorchModel:
    """Load the model that a run starts from.

    Raises:
        ValueError: it cannot be loaded, or the algorithm has other networks.
    """
    assert run.start is not None
    start = torch_model.load(run.start)
    theirs, mine = start.card.algorithm, run.algorithm
    if theirs != mine and not {theirs, mine} <= set(ON_POLICY):
        raise ValueError(f"--from {run.start}: {mine} cannot start from a model of {theirs}")
    return start


def card_for(run: Run, start: TorchModel | None) -> ModelCard:
    """The card of a run's models; network and observation are those of the model it starts from.

    Raises:
        ValueError: invalid arguments of the network or of the environment.
    """
    given = run.hyperparameters
    environment = dict(given.env_kwargs)
    policy, policy_kwargs = given.policy, given.policy_kwargs
    if start is not None:
        policy, policy_kwargs = start.card.policy, start.card.policy_kwargs
        theirs = start.card.environment
        view = {key: theirs[key] for key in OBSERVING if key in theirs}
        environment = {key: environment[key] for key in environment if key not in OBSERVING} | view
    check_environment(environment, "env_kwargs: ")
    card = card_of(run, policy, policy_kwargs, environment)
    torch_model.build(card)
    return card


def _learner(run: Run, card: ModelCard, budget: TrainingBudget) -> BaseAlgorithm:
    """The algorithm with random weights.

    Raises:
        ValueError: hyperparameters that the library refuses.
    """
    # depends on the steps, so that a training that resumes does not repeat its random numbers
    seed = int(np.random.SeedSequence((run.seed, budget.steps)).generate_state(1)[0])
    envs = VecMonitor(ObstacleFieldVecEnv(run.hyperparameters.n_envs, **run.environment(card)))
    arguments: dict[str, Any] = {
        key: value if (top := slope(value)) is None else LinearSchedule(top, budget)
        for key, value in run.hyperparameters.learner.items()
        if key not in (_CRITIC_ALONE, _LAST_STD)
    }
    if isinstance(unit := arguments.get("train_freq"), list):
        arguments["train_freq"] = tuple(unit)
    try:
        return _LEARNERS[run.algorithm](
            networks.policy_class(run.algorithm, card.policy),
            envs,
            seed=seed,
            device="cpu",
            policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
            **arguments,
        )
    except (ValueError, TypeError, AssertionError, ZeroDivisionError, RuntimeError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{run.algorithm} refuses these hyperparameters: {why}") from None


def _learn(run: Run, model: BaseAlgorithm, record: TrainingRecord, budget: TrainingBudget) -> None:
    """Train until a limit is reached, and write a checkpoint.

    Raises:
        KeyboardInterrupt: Ctrl-C; the checkpoint is written before.
    """
    model.set_logger(configure(str(run.directory / "tensorboard"), ["tensorboard"]))
    most, checkpoint = run.most_steps, run.directory / "checkpoint"
    with show_progress(run, record, budget) as progress, defer_interrupt(STOPPING) as interrupt:
        callback = _TrainingCallback(run, record, budget, interrupt, progress)
        left = (_ENDLESS if most is None else most) - model.num_timesteps
        if left > 0 and not budget.time_is_up:
            every = _LOGGED_ROLLOUTS if run.algorithm == "ppo" else _LOGGED_EPISODES
            model.learn(left, callback=callback, log_interval=every, reset_num_timesteps=False)
        model.logger.close()
        evaluated = record.curve[-1]["steps"] if record.curve else -1
        if not interrupt.pressed and evaluated < model.num_timesteps:
            record.evaluate(model, model.num_timesteps, budget.seconds)
        training_checkpoint.write(checkpoint, model, budget.seconds)


class _TrainingCallback(BaseCallback):
    """Evaluates, writes checkpoints, updates the progress bar, and stops at the limit of time.

    Evaluations and checkpoints happen between an update and the next rollout, so that a training
    that resumes has the same networks.
    """

    def __init__(
        self,
        run: Run,
        record: TrainingRecord,
        budget: TrainingBudget,
        interrupt: Interrupt,
        progress: TrainingProgress,
    ) -> None:
        super().__init__()
        self._run, self._record, self._budget = run, record, budget
        self._interrupt, self._progress = interrupt, progress
        self._critic_alone = run.hyperparameters.learner.get(_CRITIC_ALONE, 0)
        self._last_std: float | None = run.hyperparameters.learner.get(_LAST_STD)
        self._checkpoint_time = time.monotonic()

    def _on_rollout_start(self) -> None:
        if self._critic_alone:
            self._freeze_actor(self.model.num_timesteps < self._critic_alone)
        if self._last_std is not None:
            self._lower_noise(self._last_std)
        steps, curve = self.model.num_timesteps, self._record.curve
        if not curve or steps >= curve[-1]["steps"] + self._run.hyperparameters.eval_freq:
            found = self._record.evaluate(self.model, steps, self._budget.seconds)
            for name, value in (("success", found.success), ("spl", found.spl), ("gap", found.gap)):
                if value is not None:
                    self.logger.record(f"validation/{name}", value)
            self.logger.dump(steps)
        if time.monotonic() - self._checkpoint_time >= CHECKPOINT_SECONDS:
            place = self._run.directory / "checkpoint"
            training_checkpoint.write(place, self.model, self._budget.seconds)
            self._checkpoint_time = time.monotonic()

    def _freeze_actor(self, frozen: bool) -> None:
        """Train only the critic, or all networks.

        A model from imitation has a trained actor and an untrained critic, whose advantage
        estimates would ruin the actor.
        """
        for name, parameter in self.model.policy.named_parameters():
            parameter.requires_grad_(not frozen or name.startswith(_CRITIC))

    def _lower_noise(self, last: float) -> None:
        """Set the noise of actions to its value at this time."""
        policy: Any = self.model.policy
        policy.log_std.requires_grad_(False)
        done = self._budget.done
        policy.log_std.fill_((1.0 - done) * policy.log_std_init + done * math.log(last))

    def _on_step(self) -> bool:
        self._budget.steps = self.model.num_timesteps
        self._progress.update()
        return not (self._interrupt.pressed or self._budget.time_is_up)
