"""Training by name: what a run is, which algorithms there are, and where a run left off."""

from __future__ import annotations

import hashlib
import importlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol, cast

from agents.runtime.chunk_store import refuse_other
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from agents.training.hyperparameters import Hyperparameters
from ferguson_gym.runtime.atomic_files import atomic_write

CHOSEN_ON, REPORTED_ON = "standard/validation:0-199", "standard/validation:200-999"
"""Fields by which the best model is chosen, and on which its results are reported."""
_CONFIGURATION = "run.json"
_DONE = "model.json"
OWN = (
    _CONFIGURATION,
    "model.zip",
    _DONE,
    "curve.csv",
    "best",
    "checkpoint",
    "tensorboard",
)
"""What a run writes into its directory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What is to be trained, and where."""

    algorithm: str
    directory: Path
    recipe: Hyperparameters
    seed: int = 0
    steps: int | None = None
    """Segments flown at most; None: no limit if there is one of time, else the recipe's."""
    minutes: float | None = None
    """Time at most, breaks left out."""
    start: Path | None = None
    """A model whose network and weights the training begins with."""
    demos: str | None = None
    """Id of a dataset of demonstrations."""
    chosen_on: str = CHOSEN_ON
    reported_on: str = REPORTED_ON
    workers: int = 1
    """Processes, where work is split; changes no result."""
    threads: int = 1
    """Threads of torch and of the environment."""
    fresh: bool = False
    """Whether to start over, whatever the directory holds."""
    terminal: Terminal = field(default_factory=Terminal)
    """That shows how far it is."""

    @property
    def most_steps(self) -> int | None:
        """Segments flown at most; None if only time limits them."""
        if self.steps is None and self.minutes is None:
            return self.recipe.n_timesteps
        return self.steps

    def configuration(self) -> dict[str, Any]:
        """What makes it this run and no other: JSON values."""
        start = None
        if self.start is not None:
            weights = (self.start / "model.zip").read_bytes()
            start = {
                "place": str(self.start),
                "sha256": hashlib.sha256(weights).hexdigest(),
            }
        return {
            "algorithm": self.algorithm,
            "seed": self.seed,
            "steps": self.most_steps,
            "minutes": self.minutes,
            "from": start,
            "demos": self.demos,
            "chosen_on": self.chosen_on,
            "reported_on": self.reported_on,
            "hyperparameters": asdict(self.recipe),
        }


class Trainer(Protocol):
    """A module that trains; it is imported when its algorithm is asked for."""

    def prepare(self, run: Run) -> Job:
        """Check all that can be checked, and return what trains.

        The job goes on from the run's checkpoint if there is one;
        `agents.training.learning_curve.Record` keeps the curve and the best model and writes the
        final one. Interrupted, it writes a checkpoint and raises KeyboardInterrupt.

        Raises:
            ValueError: what the run asks for makes no sense; nothing is written then.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """How an algorithm's trainer is found, and which options it takes."""

    module: str
    """Of the trainer."""
    keys: frozenset[str]
    """Of the recipe, beside those that all have."""
    demos: bool = False
    """Whether it can use demonstrations."""
    needs: tuple[str, ...] = field(default=())
    """Modules that must be installed, beside those of all agents."""

    def trainer(self) -> Trainer:
        """The trainer."""
        return cast(Trainer, importlib.import_module(self.module))


_OFF_POLICY = frozenset(
    {
        *("learning_rate", "buffer_size", "learning_starts", "batch_size", "tau", "gamma"),
        *("train_freq", "gradient_steps", "noise_type", "noise_std"),
    }
)
_SOFT = _OFF_POLICY | {"ent_coef", "target_update_interval", "target_entropy"}
_SB3, _IMITATION = "agents.training.sb3", "agents.training.imitation.trainer"
_TAUGHT = frozenset(
    {
        *("expert", "scattered", "first", "updates", "batch_size", "learning_rate"),
        *("hard", "violation"),
    }
)
ALGORITHMS: Mapping[str, Algorithm] = {
    "ppo": Algorithm(
        module=_SB3,
        keys=frozenset(
            {
                *("learning_rate", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda"),
                *("clip_range", "clip_range_vf", "normalize_advantage", "ent_coef", "vf_coef"),
                *("max_grad_norm", "target_kl", "critic_alone"),
            }
        ),
    ),
    "sac": Algorithm(module=_SB3, keys=_SOFT, demos=True),
    "td3": Algorithm(
        module=_SB3,
        keys=_OFF_POLICY | {"policy_delay", "target_policy_noise", "target_noise_clip"},
        demos=True,
    ),
    "tqc": Algorithm(module=_SB3, keys=_SOFT | {"top_quantiles_to_drop_per_net"}, demos=True),
    "bc": Algorithm(module=_IMITATION, keys=_TAUGHT, demos=True),
    "dagger": Algorithm(module=_IMITATION, keys=_TAUGHT, demos=True),
}
"""By name, as the command line has them."""


def can_resume(run: Run) -> bool:
    """Whether the directory holds this very run, unfinished or finished, and it is to be resumed.

    Raises:
        ValueError: it holds something else; or another run, which is not to be removed.
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
    if not isinstance(known, dict) or set(known) != set(asked):
        raise ValueError(f"{place} is of another version; --fresh starts over")
    refuse_other(known, asked, f"the training at {run.directory}")
    return True


def finished(run: Run) -> bool:
    """Whether the run has written its final model."""
    return (run.directory / _DONE).is_file()


def begin(run: Run) -> None:
    """Make the run's directory and say in it what the run is."""
    run.directory.mkdir(parents=True, exist_ok=True)
    with atomic_write(run.directory / _CONFIGURATION) as temporary:
        temporary.write_text(json.dumps(run.configuration(), indent=1) + "\n", encoding="utf-8")


def delete_run(directory: Path) -> None:
    """Remove what a run has written, and nothing else.

    Raises:
        ValueError: the directory holds files, and none of them says that a run wrote them.
    """
    if not directory.is_dir() or not any(directory.iterdir()):
        return
    if not (directory / _CONFIGURATION).is_file():
        raise ValueError(f"--out {directory} holds other files; choose a new directory")
    for name in reversed(OWN):  # last of all what says that it is a run
        place = directory / name
        if place.is_dir():
            shutil.rmtree(place)
        else:
            place.unlink(missing_ok=True)
