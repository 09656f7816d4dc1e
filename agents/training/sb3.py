"""Reinforcement learning by Stable-Baselines3: PPO, SAC, TD3 and TQC."""

from __future__ import annotations

import shutil
import time
from typing import Any

import numba
import numpy as np
import torch
from rich.progress import Progress, TaskID
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.vec_env import VecMonitor

from agents.models import networks, torch_model
from agents.models.architecture import ON_POLICY
from agents.models.model_card import ModelCard, check_environment
from agents.models.torch_model import TorchModel
from agents.runtime.interrupts import Interrupt, defer_interrupt
from agents.runtime.jobs import DONE, Job
from agents.training import checkpoint as training_checkpoint
from agents.training import run as training
from agents.training.budget import STOPPING, LinearSchedule, TrainingBudget
from agents.training.hyperparameters import slope
from agents.training.imitation import demonstration_data
from agents.training.learning_curve import Record, card_of
from agents.training.run import Run
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.world.field_names import get_fields

CHECKPOINT_SECONDS = 300.0
"""Between checkpoints; one more is written when a training stops."""
_ENDLESS = 10**15
"""Steps of a training that only time limits."""
_LOGGED_ROLLOUTS, _LOGGED_EPISODES = 1, 100
"""After so many the library logs: on policy it counts rollouts, off policy episodes."""
_LEARNERS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3, "tqc": TQC}
_NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
_CRITIC_ALONE = "critic_alone"
"""Key of PPO's recipe that its library does not know: steps in which the critic alone learns."""
_CRITIC = ("mlp_extractor.value_net", "value_net")
_VIEW = ("observation", "nearest", "focus", "rays", "view")
"""Arguments of the environment that say what a network sees."""


def prepare(run: Run) -> Job:
    """See `agents.training.run.Trainer`."""
    start = None if run.start is None else starting_model(run)
    card = card_for(run, start)
    demos = None if run.demos is None else demonstration_data.read(run.demos)
    for spec in (run.chosen_on, run.reported_on):
        get_fields(spec)
    place = run.directory / "checkpoint"
    checkpoint = None if run.fresh else training_checkpoint.latest(place)
    counts = None if checkpoint is None else training_checkpoint.counts_of(checkpoint)
    steps, seconds = (0, 0.0) if counts is None else (counts.steps, counts.seconds)
    pace = TrainingBudget(run.most_steps, run.minutes, steps, seconds)
    numba.set_num_threads(min(run.threads, numba.get_num_threads()))
    torch.set_num_threads(run.threads)  # after Numba has started its threads and set OpenMP's
    model = _learner(run, card, pace)
    known = None
    if checkpoint is not None:
        training_checkpoint.restore(checkpoint, model)
        known = Record(run, card, steps)
    else:
        if start is not None:
            model.policy.load_state_dict(start.policy.state_dict())
        if demos is not None:
            demonstration_data.fill(_buffer(model), demos, card.environment)

    def job() -> int:
        if known is None:
            training.delete_run(run.directory)  # what came before a first checkpoint is of no use
            training.begin(run)
        record = known or Record(run, card)
        pace.start(seconds)
        _learn(run, model, record, pace)
        record.finish()
        shutil.rmtree(place)
        return DONE

    return job


def starting_model(run: Run) -> TorchModel:
    """The model that a run begins with.

    Raises:
        ValueError: there is none, or this algorithm has no use for it.
    """
    assert run.start is not None
    start = torch_model.load(run.start)
    theirs, mine = start.card.algorithm, run.algorithm
    if theirs != mine and not {theirs, mine} <= set(ON_POLICY):
        raise ValueError(f"--from {run.start}: {mine} cannot go on with a model of {theirs}")
    return start


def card_for(run: Run, start: TorchModel | None) -> ModelCard:
    """The card of the run's models; what it begins with decides on the network and what it sees.

    Raises:
        ValueError: no network, or no environment, can be made of it.
    """
    recipe = run.recipe
    environment = dict(recipe.env_kwargs)
    policy, policy_kwargs = recipe.policy, recipe.policy_kwargs
    if start is not None:
        policy, policy_kwargs = start.card.policy, start.card.policy_kwargs
        seen = {key: start.card.environment[key] for key in _VIEW if key in start.card.environment}
        environment = {key: environment[key] for key in environment if key not in _VIEW} | seen
    check_environment(environment, "env_kwargs: ")
    card = card_of(run, policy, policy_kwargs, environment)
    torch_model.build(card)
    return card


def _learner(run: Run, card: ModelCard, pace: TrainingBudget) -> BaseAlgorithm:
    """The algorithm, with weights drawn at random.

    Raises:
        ValueError: hyperparameters that it refuses.
    """
    # a sitting's own: one that goes on does not repeat what was drawn before
    seed = int(np.random.SeedSequence((run.seed, pace.steps)).generate_state(1)[0])
    envs = VecMonitor(ObstacleFieldVecEnv(run.recipe.n_envs, **card.environment))
    arguments = {key: _scheduled(value, pace) for key, value in run.recipe.learner.items()}
    arguments.pop(_CRITIC_ALONE, None)
    kind = _LEARNERS[run.algorithm]
    if (noise := _noise(arguments)) is not None:
        arguments["action_noise"] = noise
    if isinstance(unit := arguments.get("train_freq"), list):
        arguments["train_freq"] = tuple(unit)
    try:
        return kind(
            networks.policy_class(run.algorithm, card.policy),
            envs,
            seed=seed,
            device="cpu",
            policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
            **arguments,
        )
    except (ValueError, TypeError, AssertionError, ZeroDivisionError, RuntimeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{run.algorithm} refuses these hyperparameters: {reason}") from None


def _scheduled(value: Any, pace: TrainingBudget) -> Any:
    return value if (top := slope(value)) is None else LinearSchedule(top, pace)


def _noise(arguments: dict[str, Any]) -> Any:
    """The noise that `noise_type` and `noise_std` ask for, which it takes out of the arguments.

    Raises:
        ValueError: an unknown type, or one without the other.
    """
    kind, std = arguments.pop("noise_type", None), arguments.pop("noise_std", None)
    if kind is None and std is None:
        return None
    if kind not in _NOISES or not isinstance(std, (int, float)):
        raise ValueError(
            f"noise_type is one of {', '.join(_NOISES)} and noise_std a number, got {kind!r} and "
            f"{std!r}"
        )
    return _NOISES[kind](np.zeros(4), np.full(4, float(std)))


def _buffer(model: BaseAlgorithm) -> Any:
    return model.replay_buffer  # type: ignore[attr-defined]


def _learn(run: Run, model: BaseAlgorithm, record: Record, pace: TrainingBudget) -> None:
    """Train until a limit is reached, and keep a checkpoint.

    Raises:
        KeyboardInterrupt: Ctrl-C; the checkpoint is written.
    """
    model.set_logger(configure(str(run.directory / "tensorboard"), ["tensorboard"]))
    most, checkpoint = run.most_steps, run.directory / "checkpoint"
    with defer_interrupt(STOPPING) as interrupt, run.terminal.share_bar() as bar:
        watch = _Watch(run, record, pace, interrupt, bar)
        left = (_ENDLESS if most is None else most) - model.num_timesteps
        if left > 0 and not pace.time_is_up:
            every = _LOGGED_ROLLOUTS if run.algorithm == "ppo" else _LOGGED_EPISODES
            model.learn(left, callback=watch, log_interval=every, reset_num_timesteps=False)
        model.logger.close()
        evaluated = record.curve[-1]["steps"] if record.curve else -1
        if not interrupt.pressed and evaluated < model.num_timesteps:
            record.consider(model, model.num_timesteps, pace.seconds)
        training_checkpoint.write(checkpoint, model, pace.seconds)


class _Watch(BaseCallback):
    """Looks on: evaluates, writes checkpoints, moves the bar, stops when it is time.

    Evaluations and checkpoints happen between an update and the next flights, when the networks
    are as they will be if the training goes on from there.
    """

    def __init__(
        self, run: Run, record: Record, pace: TrainingBudget, interrupt: Interrupt, bar: Progress
    ) -> None:
        super().__init__()
        self._run, self._record, self._pace = run, record, pace
        self._interrupt, self._bar = interrupt, bar
        self._critic_alone = run.recipe.learner.get(_CRITIC_ALONE, 0)
        self._task: TaskID = bar.add_task(run.algorithm, total=1.0)
        self._written = time.monotonic()

    def _on_rollout_start(self) -> None:
        if self._critic_alone:
            self._teach_critic(alone=self.model.num_timesteps < self._critic_alone)
        steps, curve = self.model.num_timesteps, self._record.curve
        if not curve or steps >= curve[-1]["steps"] + self._run.recipe.eval_freq:
            found = self._record.consider(self.model, steps, self._pace.seconds)
            for name, value in (("success", found.success), ("spl", found.spl), ("gap", found.gap)):
                if value is not None:
                    self.logger.record(f"validation/{name}", value)
            self.logger.dump(steps)
        if time.monotonic() - self._written >= CHECKPOINT_SECONDS:
            place = self._run.directory / "checkpoint"
            training_checkpoint.write(place, self.model, self._pace.seconds)
            self._written = time.monotonic()

    def _teach_critic(self, alone: bool) -> None:
        """Let the critic learn alone, or all networks.

        The actor of a model that was not trained by PPO knows what to do, and its critic nothing:
        by such a critic's advice the actor would unlearn it.
        """
        for name, parameter in self.model.policy.named_parameters():
            parameter.requires_grad_(not alone or name.startswith(_CRITIC))

    def _on_step(self) -> bool:
        self._pace.steps = self.model.num_timesteps
        best = self._record.best
        words = f"{self._run.algorithm}, {self._pace.steps:,} steps"
        self._bar.update(
            self._task,
            completed=self._pace.done,
            description=words if best is None else f"{words}, best SPL {best:.4f}",
        )
        return not (self._interrupt.pressed or self._pace.time_is_up)
