"""Reading demonstrations: the expert, the fields, and the actions of each flight."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import ferguson_gym
from agents.demonstrations.episode import make_environment, replay
from agents.demonstrations.minari_store import local_ids, minari, place_of
from agents.runtime.safe_npz import reason
from ferguson_gym.simulation import Observation, saved_arguments
from ferguson_gym.world.actions import Action

_SAME = 1e-6
"""Tolerance of path lengths [m] and rewards, which differ between machines by rounding."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Demonstrations:
    """Flights of an expert.

    Actions and fields suffice: a replay returns every state, and every observation in any settings
    of the environment.
    """

    dataset_id: str
    expert: str
    """Name of the planner, with its options."""
    fields: tuple[str, ...]
    """Names of the fields, one for each flight."""
    actions: Action
    """(steps of all flights, 4)."""
    offsets: NDArray[np.int64]
    """(flights + 1,) flight i flew `actions[offsets[i] : offsets[i + 1]]`."""
    environment: Mapping[str, Any]
    """Arguments of the environment that the flights were recorded in."""
    metadata: Mapping[str, Any]
    """All metadata of the dataset."""

    def __len__(self) -> int:
        return len(self.fields)

    def flight(self, i: int) -> Action:
        """Actions (n, 4) of flight i."""
        return self.actions[self.offsets[i] : self.offsets[i + 1]]


def read(dataset_id: str) -> Demonstrations:
    """Read a dataset written by `ferguson demos`, and check that it belongs to this environment.

    Its first and its last flight are replayed and compared with what was recorded.

    Raises:
        ValueError: a malformed or unknown id, a damaged dataset, one of another environment or of
            another version of this one, or Minari is not installed.
    """
    place = place_of(dataset_id)
    if not (place / "data").is_dir():
        known = ", ".join(local_ids()) or "none"
        raise ValueError(f"no dataset {dataset_id} at {place}; existing datasets: {known}")
    with _damage_as_value_error(dataset_id):
        _check_sizes(place / "data" / "main_data.hdf5")
        dataset = minari().load_dataset(dataset_id)
        metadata: dict[str, Any] = dict(dataset.storage.metadata)
        spec = dataset.env_spec
    recorded = metadata.get("demonstrations")
    if recorded is None or spec is None or spec.id != ferguson_gym.ENVIRONMENT_ID:
        whose = "without an environment" if spec is None else f"of {spec.id}"
        raise ValueError(
            f"dataset {dataset_id} is {whose}{' and not by ferguson demos' * (recorded is None)}; "
            f"need demonstrations in {ferguson_gym.ENVIRONMENT_ID}, written by ferguson demos"
        )
    with _damage_as_value_error(dataset_id):
        expert, flights = str(recorded["expert"]), recorded["flights"]
        fields = tuple(
            str(note["options"]["field"])
            for note in dataset.storage.get_episode_metadata(dataset.episode_indices)
        )
        ends, actions = [], []
        for i, episode in enumerate(dataset.iterate_episodes()):
            actions.append(np.asarray(episode.actions, np.float32).reshape(-1, 4))
            if i in (0, len(fields) - 1):
                ends.append((fields[i], episode))
        if not 0 < len(fields) == len(actions) == flights:
            raise ValueError(f"{len(actions)} flights instead of {flights}")
        every, offsets = np.concatenate(actions), np.cumsum([0, *map(len, actions)])
        if not (np.abs(every) <= 1.0).all():
            raise ValueError("actions outside [-1, 1]")
        environment = saved_arguments(spec.kwargs)
        env = make_environment(environment)
    for name, episode in ends:
        _check(dataset_id, env, name, episode)
    return Demonstrations(
        dataset_id=dataset_id,
        expert=expert,
        fields=fields,
        actions=every,
        offsets=offsets,
        environment=environment,
        metadata=metadata,
    )


def _check_sizes(path: Path) -> None:
    """Raise ValueError for arrays that claim more bytes than their file has, before any is read."""
    h5py: Any = importlib.import_module("h5py")
    most = path.stat().st_size

    def look(name: str, entry: Any) -> None:
        if isinstance(entry, h5py.Dataset) and entry.nbytes > most:
            raise ValueError(f"{name} has {entry.nbytes:,} bytes, and the file {most:,}")

    with h5py.File(path) as file:
        file.visititems(look)


@contextmanager
def _damage_as_value_error(dataset_id: str) -> Iterator[None]:
    """Report every error of the libraries that read a damaged file as a ValueError."""
    try:
        yield
    except Exception as error:
        raise ValueError(
            f"dataset {dataset_id} is damaged or cannot be read ({reason(error)}); write it again "
            "with ferguson demos --fresh"
        ) from error


def _check(dataset_id: str, env: gym.Env[Observation, Action], field: str, recorded: Any) -> None:
    """Replay a recorded episode; raises ValueError if the replay differs from what was recorded."""
    try:
        again = replay(env, field, np.asarray(recorded.actions, np.float32))
        same = (
            again.outcome.success
            and len(again.rewards) == len(recorded.rewards)
            and np.allclose(again.rewards, recorded.rewards, atol=_SAME)
            and np.allclose(again.infos["path_length"], recorded.infos["path_length"], atol=_SAME)
        )
    except Exception:  # an unknown field, or one of many errors on damaged data
        same = False
    if not same:
        raise ValueError(
            f"dataset {dataset_id} was recorded with another version of the environment: the "
            f"replay of its flight through {field} differs; write it again with ferguson demos"
        )
