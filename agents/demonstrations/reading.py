"""Reading demonstrations: whose they are, through which fields, and the actions flown."""

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
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world.actions import Action

_SAME = 1e-6
"""By which flown length [m] and rewards may differ between machines."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Demonstrations:
    """Flights of an expert, one after the other.

    The actions are all that is needed: flown again through the same fields, they give every state
    and, with whatever settings, every observation.
    """

    dataset_id: str
    expert: str
    """The name of a policy, with its options."""
    fields: tuple[str, ...]
    """Names, one a flight."""
    actions: Action
    """(steps of all flights, 4)."""
    offsets: NDArray[np.int64]
    """(flights + 1,) flight i flew `actions[offsets[i] : offsets[i + 1]]`."""
    environment: Mapping[str, Any]
    """Arguments of the environment that they were recorded in."""
    metadata: Mapping[str, Any]
    """Other metadata of the dataset."""

    def __len__(self) -> int:
        return len(self.fields)

    def flight(self, i: int) -> Action:
        """Actions (n, 4) of a flight."""
        return self.actions[self.offsets[i] : self.offsets[i + 1]]


def read(dataset_id: str) -> Demonstrations:
    """Read a dataset that `ferguson demos` wrote, and see that it belongs to this environment.

    Its first and its last flight are flown again, and must be what was recorded.

    Raises:
        ValueError: a malformed or unknown id, a dataset of another environment or of another
            version of it, a damaged one, or no Minari.
    """
    place = place_of(dataset_id)
    if not (place / "data").is_dir():
        known = ", ".join(local_ids()) or "none"
        raise ValueError(f"no dataset {dataset_id} at {place}; datasets that are there: {known}")
    with _sound(dataset_id):
        _check_sizes(place / "data" / "main_data.hdf5")
        dataset = minari().load_dataset(dataset_id)
        metadata: dict[str, Any] = dict(dataset.storage.metadata)
        spec = dataset.env_spec
    told = metadata.get("demonstrations")
    if told is None or spec is None or spec.id != ferguson_gym.ENVIRONMENT_ID:
        whose = "without an environment" if spec is None else f"of {spec.id}"
        raise ValueError(
            f"dataset {dataset_id} is {whose}{' and not by ferguson demos' * (told is None)}; need "
            f"demonstrations in {ferguson_gym.ENVIRONMENT_ID}, written by ferguson demos"
        )
    with _sound(dataset_id):
        expert, flights = str(told["expert"]), told["flights"]
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
        env = make_environment(spec.kwargs)
    for name, episode in ends:
        _check(dataset_id, env, name, episode)
    return Demonstrations(
        dataset_id=dataset_id,
        expert=expert,
        fields=fields,
        actions=every,
        offsets=offsets,
        environment=dict(spec.kwargs),
        metadata=metadata,
    )


def _check_sizes(path: Path) -> None:
    """Refuse arrays that claim to be larger than their file, before memory is asked for them.

    Raises:
        ValueError: there is one.
    """
    h5py: Any = importlib.import_module("h5py")
    most = path.stat().st_size

    def look(name: str, entry: Any) -> None:
        if isinstance(entry, h5py.Dataset) and entry.nbytes > most:
            raise ValueError(f"{name} has {entry.nbytes:,} bytes, and the file {most:,}")

    with h5py.File(path) as file:
        file.visititems(look)


@contextmanager
def _sound(dataset_id: str) -> Iterator[None]:
    """Whatever error a damaged file makes of the libraries that read it is a ValueError."""
    try:
        yield
    except Exception as error:
        raise ValueError(
            f"dataset {dataset_id} is damaged or cannot be read ({reason(error)}); write it again "
            "with ferguson demos --fresh"
        ) from error


def _check(dataset_id: str, env: gym.Env[Observation, Action], field: str, recorded: Any) -> None:
    """Fly a recorded episode again.

    Raises:
        ValueError: it is another flight now.
    """
    try:
        again = replay(env, field, np.asarray(recorded.actions, np.float32))
        same = (
            again.outcome.success
            and len(again.rewards) == len(recorded.rewards)
            and np.allclose(again.rewards, recorded.rewards, atol=_SAME)
            and np.allclose(again.infos["path_length"], recorded.infos["path_length"], atol=_SAME)
        )
    except Exception:  # a field that this environment does not know, or whatever damage makes
        same = False
    if not same:
        raise ValueError(
            f"dataset {dataset_id} was recorded with another version of the environment: its "
            f"flight through {field} is another one now; write it again with ferguson demos"
        )
