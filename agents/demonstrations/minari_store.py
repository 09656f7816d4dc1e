"""Demonstrations as a Minari dataset in HDF5: its location, and how it is written atomically.

Reference:
    Younis et al. (2024), Minari, https://minari.farama.org.
"""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import os
import re
import shutil
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents.demonstrations.episode import FLAT, Episode, make_environment, seed_of
from ferguson_gym.runtime.optional_dependencies import installing

_ID = re.compile(r"(?P<namespace>(?:[a-z0-9_][\w-]+/)*)[a-z0-9_][\w-]*-v[0-9]+", re.ASCII | re.I)
_BATCH = 500
"""Episodes that are held in memory and written at a time."""


def require_minari() -> None:
    """Raise ValueError unless Minari and h5py are installed; does not import them."""
    if any(importlib.util.find_spec(module) is None for module in ("minari", "h5py")):
        raise ValueError(f"demonstrations need Minari: {installing('demos')}")


def minari() -> Any:
    """Import Minari; raises ValueError if it is not installed."""
    require_minari()
    return importlib.import_module("minari")


def namespace_of(dataset_id: str) -> str:
    """The namespace of a dataset's id; empty if it has none.

    Raises:
        ValueError: a malformed id.
    """
    match = _ID.fullmatch(dataset_id)
    if match is None:
        raise ValueError(
            "a dataset's id is NAME-vN or NAMESPACE/NAME-vN, for example ferguson/guided-v0, "
            f"with a namespace of two letters or more; got {dataset_id!r}"
        )
    return match["namespace"].rstrip("/")


def place_of(dataset_id: str) -> Path:
    """The directory of a dataset, whether it exists or not; below `MINARI_DATASETS_PATH` if set.

    Raises:
        ValueError: a malformed id, or Minari is not installed.
    """
    namespace_of(dataset_id)
    require_minari()
    return _datasets_root() / dataset_id


def _datasets_root() -> Path:
    """The root of Minari's datasets; Minari's own function would create it."""
    given = os.environ.get("MINARI_DATASETS_PATH")
    return Path.home() / ".minari" / "datasets" if given is None else Path(given)


def local_ids() -> list[str]:
    """Ids of the datasets on this machine."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about datasets in a wrong location
        return list(minari().list_local_datasets())


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """Metadata of a dataset."""

    dataset_id: str
    expert: str
    arguments: Mapping[str, Any]
    """Arguments of the environment."""
    description: str
    random_return: float
    """Mean return of random actions: the score 0."""
    expert_return: float
    """Mean return of the demonstrations: the score 1."""
    random_flights: int
    """Number of flights in the mean return of random actions."""
    more: Mapping[str, Any]
    """Further metadata under the key `demonstrations`, as JSON values."""


def write(label: Label, episodes: Iterable[Episode], staging: Path, fresh: bool) -> Iterator[int]:
    """Write a dataset in a staging directory and move it to its location.

    Args:
        label: metadata of the dataset.
        episodes: at least one.
        staging: an empty directory on the same disk as the dataset's location.
        fresh: whether to replace a dataset of this id.

    Yields:
        The number of episodes written, batch by batch.

    Raises:
        FileExistsError: a dataset of this id exists and `fresh` is false.
    """
    place = place_of(label.dataset_id)
    with _datasets_below(staging):
        dataset, coming = None, map(_buffer, episodes)
        while batch := list(itertools.islice(coming, _BATCH)):
            if dataset is None:
                dataset = _create(label, batch)
            else:
                dataset.update_dataset_from_buffer(batch)
            yield len(batch)
        assert dataset is not None
        dataset.storage.update_metadata({"demonstrations": dict(label.more)})
        written = place_of(label.dataset_id)
    _register_namespace(namespace_of(label.dataset_id))
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.exists():
        if not fresh:
            raise FileExistsError(f"a dataset {label.dataset_id} appeared at {place} meanwhile")
        place.rename(staging / "replaced")
    written.rename(place)


def _create(label: Label, batch: list[Any]) -> Any:
    env = make_environment(label.arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about an author and other missing metadata
        return minari().create_dataset_from_buffers(
            dataset_id=label.dataset_id,
            buffer=batch,
            env=env.spec,
            algorithm_name=label.expert,
            description=label.description,
            ref_min_score=label.random_return,
            ref_max_score=label.expert_return,
            num_episodes_average_score=label.random_flights,
            data_format="hdf5",
        )


def _buffer(episode: Episode) -> Any:
    data: Any = importlib.import_module("minari.data_collector")
    return data.EpisodeBuffer(
        seed=seed_of(episode.field),
        options={"field": episode.field},
        observations=episode.observations.get(FLAT, dict(episode.observations)),
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=episode.terminations,
        truncations=episode.truncations,
        infos=dict(episode.infos),
    )


@contextmanager
def _datasets_below(root: Path) -> Iterator[None]:
    """Make Minari write below a directory; only an environment variable tells it where."""
    before = os.environ.get("MINARI_DATASETS_PATH")
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    os.environ["MINARI_DATASETS_PATH"] = str(root)
    try:
        yield
    finally:
        if before is None:
            del os.environ["MINARI_DATASETS_PATH"]
        else:
            os.environ["MINARI_DATASETS_PATH"] = before


def _register_namespace(namespace: str) -> None:
    spaces: Any = importlib.import_module("minari.namespace")
    if namespace and namespace not in spaces.list_local_namespaces():
        spaces.create_namespace(namespace)
