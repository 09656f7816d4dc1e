"""Runs of training: their configuration, the algorithms by name, and the files they write."""

from __future__ import annotations

import hashlib
import importlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Protocol, cast

from agents.models.model_card import ModelCard
from agents.runtime.chunk_store import refuse_other
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from agents.training.hyperparameters import Hyperparameters
from agents.training.imitation.options import ImitationOptions
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world import Field, get_fields

CHOSEN_ON, REPORTED_ON = "standard/validation:0-199", "standard/validation:200-999"
"""Fields on which the best model is chosen, and fields on which it is reported."""
_CONFIGURATION = "run.json"
_DONE = "model.json"
PROGRESS = "progress.json"
FILES = (
    *(_CONFIGURATION, "model.zip", _DONE, "curve.csv", PROGRESS),
    *("best", "checkpoint", "tensorboard"),
)
"""Names of what a run writes into its directory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Configuration of a training and its directory."""

    algorithm: str
    directory: Path
    hyperparameters: Hyperparameters
    seed: int = 0
    steps: int | None = None
    """Limit of steps; None: no limit if time is limited, else `n_timesteps`.

    A step is a training sample of `bc`, a state that was visited of `dagger`, and a flown
    segment of the other algorithms.
    """
    minutes: float | None = None
    """Limit of time, summed over interruptions."""
    start: Path | None = None
    """Model whose network and weights the training starts from."""
    demos: str | None = None
    """Id of a Minari dataset of demonstrations."""
    fields: tuple[str, ...] = ()
    """Fields to train on, by name, file or directory; empty: those of the environment."""
    chosen_on: str = CHOSEN_ON
    """Fields on which the best model is chosen; names are separated by commas."""
    reported_on: str = REPORTED_ON
    """Fields on which it is reported, likewise."""
    workers: int = 1
    """Number of worker processes; does not change the result."""
    threads: int = 1
    """Number of threads of PyTorch and of the environment."""
    fresh: bool = False
    """Whether to remove an earlier run in the directory."""
    terminal: Terminal = field(default_factory=Terminal)
    """Shows progress."""

    @property
    def most_steps(self) -> int | None:
        """Limit of steps; None if only time is limited."""
        if self.steps is None and self.minutes is None:
            return self.hyperparameters.n_timesteps
        return self.steps

    def environment(self, card: ModelCard) -> dict[str, Any]:
        """Arguments of the environment to train in, for models with this card.

        The card holds no fields, since its models fly through any.
        """
        return card.environment | ({"fields": list(self.fields)} if self.fields else {})

    def configuration(self) -> dict[str, Any]:
        """What identifies the run, as JSON values."""
        start = None
        if self.start is not None:
            weights = (self.start / "model.zip").read_bytes()
            start = {"place": str(self.start), "sha256": hashlib.sha256(weights).hexdigest()}
        return {
            "algorithm": self.algorithm,
            "seed": self.seed,
            "steps": self.most_steps,
            "minutes": self.minutes,
            "from": start,
            "demos": self.demos,
            "fields": list(self.fields) or None,
            "chosen_on": self.chosen_on,
            "reported_on": self.reported_on,
            # fields are the run's own, those of the hyperparameters unless others were given
            "hyperparameters": {
                key: value
                for key, value in asdict(self.hyperparameters).items()
                if key not in ("fields", "choose_on")
            },
        }


def fields_named(spec: str) -> list[Field]:
    """The fields of names that are separated by commas.

    Raises:
        ValueError: as `ferguson_gym.world.get_fields`.
    """
    return [field for name in spec.split(",") for field in get_fields(name.strip())]


class Trainer(Protocol):
    """A module that trains; it is imported when one of its algorithms is used."""

    def prepare(self, run: Run) -> Job:
        """Check a run and return the job that trains.

        The job resumes from the run's checkpoint if there is one.
        `agents.training.learning_curve.TrainingRecord` keeps the learning curve and the best model,
        and writes the final one. An interrupted job raises KeyboardInterrupt: one of
        Stable-Baselines3 writes a checkpoint before, one of imitation repeats the round when it
        resumes.

        Raises:
            ValueError: an invalid run; then nothing is written.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """Where an algorithm's trainer is, and its hyperparameters."""

    module: str
    """Module of the trainer."""
    keys: frozenset[str]
    """Names of the algorithm's own hyperparameters."""
    demos: bool = False
    """Whether it can use demonstrations."""

    def trainer(self) -> Trainer:
        """Import the trainer."""
        return cast(Trainer, importlib.import_module(self.module))


_OFF_POLICY = frozenset(
    {
        *("learning_rate", "buffer_size", "learning_starts", "batch_size", "tau", "gamma"),
        *("train_freq", "gradient_steps", "ent_coef", "target_update_interval", "target_entropy"),
        "top_quantiles_to_drop_per_net",
    }
)
_ON_POLICY = frozenset(
    {
        *("learning_rate", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda"),
        *("clip_range", "clip_range_vf", "normalize_advantage", "ent_coef", "vf_coef"),
        *("max_grad_norm", "target_kl", "critic_alone", "last_std"),
    }
)
_SB3, _IMITATION = "agents.training.sb3", "agents.training.imitation.trainer"
_OPTIONS = frozenset(option.name for option in fields(ImitationOptions))
ALGORITHMS: Mapping[str, Algorithm] = {
    "ppo": Algorithm(module=_SB3, keys=_ON_POLICY),
    "tqc": Algorithm(module=_SB3, keys=_OFF_POLICY, demos=True),
    "bc": Algorithm(module=_IMITATION, keys=_OPTIONS, demos=True),
    "dagger": Algorithm(module=_IMITATION, keys=_OPTIONS, demos=True),
}
"""Algorithms by their name on the command line."""


def can_resume(run: Run) -> bool:
    """Whether the directory holds this run, unfinished or finished, and `fresh` is not set.

    Raises:
        ValueError: the directory holds other files, or another run and `fresh` is not set.
    """
    place = run.directory / _CONFIGURATION
    if run.fresh and place.is_file():
        return False
    try:
        known = json.loads(place.read_text(encoding="utf-8"))
    except FileNotFoundError:
        if run.directory.is_dir() and any(run.directory.iterdir()):
            raise ValueError(
                f"--out {run.directory} holds other files; choose a new directory"
            ) from None
        return False
    except (ValueError, RecursionError):
        raise ValueError(f"{place} is damaged; --fresh starts over") from None
    asked = run.configuration()
    if isinstance(known, dict):
        known = {"fields": None} | known  # trainings could not name them before
    if not isinstance(known, dict) or set(known) != set(asked):
        raise ValueError(f"{place} is of another version; --fresh starts over")
    refuse_other(known, asked, f"the training at {run.directory}")
    return True


def finished(run: Run) -> bool:
    """Whether the run has written its final model."""
    return (run.directory / _DONE).is_file()


def begin(run: Run) -> None:
    """Create the run's directory and write its configuration."""
    run.directory.mkdir(parents=True, exist_ok=True)
    with atomic_write(run.directory / _CONFIGURATION) as temporary:
        temporary.write_text(json.dumps(run.configuration(), indent=1) + "\n", encoding="utf-8")


def delete_run(directory: Path) -> None:
    """Remove the files of a run and no others.

    Raises:
        ValueError: the directory holds files but no configuration of a run.
    """
    if not directory.is_dir() or not any(directory.iterdir()):
        return
    if not (directory / _CONFIGURATION).is_file():
        raise ValueError(f"--out {directory} holds other files; choose a new directory")
    for name in reversed(FILES):  # last, the file that marks the directory as a run
        place = directory / name
        if place.is_dir():
            shutil.rmtree(place)
        else:
            place.unlink(missing_ok=True)
