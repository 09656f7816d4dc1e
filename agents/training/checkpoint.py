"""Checkpoints of Stable-Baselines3 algorithms, written atomically and read without unpickling.

A checkpoint is a directory named by its number of steps. It is moved into place when it is
complete; the one before it is removed after that. It holds all networks with their optimizers
(`model.zip`), counters (`state.json`) and, for off-policy algorithms, the replay buffer
(`buffer.npz`). Unfinished flights and streams of random numbers are not stored: a training that
resumes starts new flights, with streams seeded by the run's seed and the steps so far.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file, recursive_setattr

from agents.runtime.safe_npz import reason

_MODEL, _STATE, _BUFFER = "model.zip", "state.json", "buffer.npz"
_UNFINISHED = ".writing-"
_FUNCTIONS = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Counters of a training."""

    steps: int
    seconds: float
    updates: int
    """Updates of the networks."""
    episodes: int


def write(directory: Path, model: BaseAlgorithm, seconds: float) -> None:
    """Write a checkpoint into a directory of checkpoints and remove the earlier ones."""
    directory.mkdir(parents=True, exist_ok=True)
    counts = Counts(
        steps=model.num_timesteps,
        seconds=seconds,
        updates=model._n_updates,
        episodes=model._episode_num,
    )
    temporary = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=directory))
    try:
        model.save(temporary / _MODEL, exclude=_FUNCTIONS)
        (temporary / _STATE).write_text(json.dumps(asdict(counts)) + "\n", encoding="utf-8")
        if (buffer := getattr(model, "replay_buffer", None)) is not None:
            np.savez(temporary / _BUFFER, **_arrays(buffer))  # type: ignore[arg-type]
        place = directory / str(counts.steps)
        if place.exists():  # after the same number of steps, so nothing is lost
            shutil.rmtree(place)
        temporary.rename(place)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for old in directory.iterdir():
        if old != place:
            shutil.rmtree(old)


def latest(directory: Path) -> Path | None:
    """The latest checkpoint in a directory of checkpoints; None if there is none."""
    places = directory.iterdir() if directory.is_dir() else ()
    whole = [place for place in places if place.name.isdecimal()]
    return max(whole, key=lambda place: int(place.name), default=None)


def counts_of(checkpoint: Path) -> Counts:
    """The counters of a checkpoint.

    Raises:
        ValueError: the checkpoint is damaged.
    """
    try:
        counts = Counts(**json.loads((checkpoint / _STATE).read_text(encoding="utf-8")))
        for key, number in asdict(counts).items():
            kinds = (int, float) if key == "seconds" else (int,)
            if type(number) not in kinds or not 0 <= number < 2**63:
                raise ValueError(f"{key} {number!r}")
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise damaged(checkpoint, error) from None
    return counts


def restore(checkpoint: Path, model: BaseAlgorithm) -> None:
    """Load a checkpoint into a new algorithm with the same hyperparameters.

    Raises:
        ValueError: the checkpoint is damaged, or of other networks.
    """
    counts = counts_of(checkpoint)
    try:
        # load_data=False: pickled attributes are not read, only weights are
        file = checkpoint / _MODEL
        _, networks, variables = load_from_zip_file(file, device="cpu", load_data=False)
        model.set_parameters(networks, exact_match=True, device="cpu")
        for name, value in (variables or {}).items():
            if value is not None:
                recursive_setattr(model, f"{name}.data", value.data)
        if (buffer := getattr(model, "replay_buffer", None)) is not None:
            _fill(buffer, checkpoint / _BUFFER)
    except Exception as error:  # the libraries raise errors of many types on a damaged file
        raise damaged(checkpoint, error) from None
    model.num_timesteps = counts.steps
    model._n_updates, model._episode_num = counts.updates, counts.episodes


def damaged(checkpoint: Path, error: Exception) -> ValueError:
    """The error that a checkpoint which cannot be read is reported with."""
    return ValueError(
        f"the checkpoint {checkpoint} cannot be read ({reason(error)}); --fresh starts over"
    )


def _arrays(buffer: Any) -> dict[str, NDArray[Any]]:
    """The filled rows of a replay buffer, and the counters that say which they are."""
    rows = slice(buffer.buffer_size if buffer.full else buffer.pos)
    arrays = {name: getattr(buffer, name)[rows] for name in ("actions", "rewards", "dones")}
    arrays["timeouts"] = buffer.timeouts[rows]
    arrays |= {"pos": np.array(buffer.pos), "full": np.array(buffer.full)}
    for key, value in buffer.observations.items():
        arrays[f"observations.{key}"] = value[rows]
        arrays[f"next_observations.{key}"] = buffer.next_observations[key][rows]
    return arrays


def _fill(buffer: Any, path: Path) -> None:
    """Load saved rows into a replay buffer; the inverse of `_arrays`."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as saved:
            for name in saved.files:
                if name in ("pos", "full"):
                    continue
                whole, _, key = name.partition(".")
                target = getattr(buffer, whole)
                target = target[key] if key else target
                target[: len(saved[name])] = saved[name]
            buffer.pos, buffer.full = int(saved["pos"]), bool(saved["full"])
            if not 0 <= buffer.pos < buffer.buffer_size:
                raise ValueError(f"position {buffer.pos} of {buffer.buffer_size}")
    except (OSError, zipfile.BadZipFile, KeyError) as error:
        raise ValueError(f"{path.name}: {error}") from None
