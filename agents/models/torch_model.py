"""Models in torch: as they are built, trained and saved, and flown if nothing else knows them."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor

from agents.models import networks, weights
from agents.models.architecture import architecture_of
from agents.models.inference.activations import Single
from agents.models.inference.forward import Forward
from agents.models.model import MODEL, Model, Network, directory_of
from agents.models.model_card import CARD, Card, read_card, write_card
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.spaces import action_space, observation_space
from ferguson_gym.world.actions import Action

BLOCK = 16
"""Rows that a network is asked about at a time."""
_PICKLED = "policy.pth"
"""Weights as the library saves them."""
WIDEST, DEEPEST = 8192, 64
"""Of the networks that are built: a card can ask for any number of units and layers."""
_NOT_DATA = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf", "ep_info_buffer")
"""Attributes left out of the zip: functions of a training that is over."""


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """A policy with all that is trained of it, and what is known of it."""

    policy: BasePolicy
    """On the processor."""
    card: Card

    @property
    def weights(self) -> dict[str, Single]:
        """What the policy has learned, shared with it; what has two names is there once."""
        return {name: value.numpy() for name, value in _distinct(self.policy).items()}

    @property
    def model(self) -> Model:
        """As it flies, from its weights as they are now."""
        architecture = architecture_of(self.card)
        network: Network = (
            TorchNetwork(self.policy)
            if architecture is None
            else Forward(architecture, self.weights)
        )
        return Model(network, self.card)


def _distinct(policy: BasePolicy) -> dict[str, Tensor]:
    """Weights under the first of their names: actor and critic may share them."""
    found: dict[int, tuple[str, Tensor]] = {}
    for name, value in policy.state_dict().items():
        found.setdefault(value.data_ptr(), (name, value))
    return dict(found.values())


def build(card: Card, where: str = "") -> BasePolicy:
    """The network that a card describes, with weights drawn at random.

    Raises:
        ValueError: no network can be built of it; the message begins with `where`.
    """
    try:
        _check_sizes(card.policy_kwargs)
        kind = networks.policy_class(card.algorithm, card.policy)
        kwargs = networks.features(card.policy, card.policy_kwargs)
        seen = observation_space(settings_of(card.environment))
        return kind(seen, action_space(), lambda _: 0.0, **kwargs)
    except (ValueError, TypeError, AssertionError, RuntimeError, KeyError) as error:
        raise ValueError(f"{where}{_first_line(error)}") from None


def _check_sizes(given: object) -> None:
    """Refuse networks of sizes that would take the memory, or hours to fill with random weights."""
    if isinstance(given, Mapping):
        given = list(given.values())
    if isinstance(given, (list, tuple)):
        if len(given) > DEEPEST:
            raise ValueError(f"at most {DEEPEST} layers, got {len(given)}")
        for one in given:
            _check_sizes(one)
    elif isinstance(given, int) and given > WIDEST:
        raise ValueError(f"layers of at most {WIDEST} units, got {given}")


def save(directory: Path, model: BaseAlgorithm, card: Card) -> None:
    """Write a model into a directory that exists; each file is written whole.

    The library's own zip, which it goes on with, and in it the weights once more as flights read
    them, without torch.
    """
    card.to_json()  # what it refuses, it refuses before anything is written
    with atomic_write(directory / MODEL) as temporary:
        model.save(temporary, exclude=_NOT_DATA)
        with zipfile.ZipFile(temporary, "a") as archive:
            weights.write(archive, Learned(model.policy, card).weights)
    write_card(directory, card)


def slim(source: Path, directory: Path) -> None:
    """Copy a model's weights and card, and nothing that only training needs.

    Raises:
        ValueError: as `load`.
    """
    learned = load(source)
    directory.mkdir(parents=True, exist_ok=True)
    with atomic_write(directory / MODEL) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        weights.write(archive, learned.weights)
    write_card(directory, learned.card)


def load(place: str | Path) -> Learned:
    """The policy that lies in a directory, or beside its `model.zip`, to be trained or flown.

    Raises:
        ValueError: as `agents.models.loading.load`.
    """
    directory = directory_of(place)
    card = read_card(directory / CARD)
    policy, path = build(card, f"{directory / CARD}: "), directory / MODEL
    if weights.names(path):
        own = _distinct(policy)
        read = weights.read(path, {name: tuple(value.shape) for name, value in own.items()})
        with torch.no_grad():
            for name, value in own.items():
                value.copy_(torch.from_numpy(read[name]))
    else:
        _take(policy, _unpickled(path), path)
    policy.set_training_mode(False)
    return Learned(policy, card)


def _take(policy: BasePolicy, given: Mapping[str, Tensor], path: Path) -> None:
    """Give a policy the weights of a file, if they are its own."""
    try:
        policy.load_state_dict(given)
    except (RuntimeError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{path}: its weights are not those of the network that {CARD} describes "
            f"({_first_line(error)})"
        ) from None
    if not all(torch.isfinite(weight).all() for weight in policy.state_dict().values()):
        raise ValueError(f"{path}: weights that are not finite")


def _unpickled(path: Path) -> dict[str, Tensor]:
    """Weights of a model that has no others; torch's reader of weights takes nothing else."""
    try:
        with zipfile.ZipFile(path) as archive:
            if (size := archive.getinfo(_PICKLED).file_size) > 4 * weights.MOST:
                raise ValueError(f"{path}: {size:,} bytes of weights; at most {4 * weights.MOST:,}")
            # at once: torch would go to and fro in it, and each time unpack from the beginning
            file = io.BytesIO(archive.read(_PICKLED))
    except KeyError:
        raise ValueError(
            f"{path}: no weights in it: cut short, or no model that was saved here"
        ) from None
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError):
        raise ValueError(f"{path}: not a zip file, or damaged") from None
    try:
        read = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # torch promises no kinds; whatever it is, these are no weights
        raise ValueError(
            f"{path}: {_PICKLED} does not hold weights alone, and nothing else is read "
            f"({type(error).__name__})"
        ) from None
    if not isinstance(read, dict):
        raise ValueError(f"{path}: {_PICKLED} does not hold weights")
    return read


def _first_line(error: BaseException) -> str:
    """Of a message that may be long, what matters."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[1] if len(lines) > 1 and lines[0].endswith(":") else " ".join(lines[:1])


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch compute with one thread; then with as many as before.

    Not for single steps: threads that are called back burn processor time until they sleep.
    """
    before = torch.get_num_threads()
    # even if it says one: that is OpenMP's number, not that of the library of matrix products
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class TorchNetwork:
    """A policy of torch as a `agents.models.model.Network`.

    A matrix product of another number of rows may differ in its last bit, and a flight with it. So
    the policy is always asked about `BLOCK` rows, the last ones empty if need be, by one thread:
    then a row is treated alike whatever stands beside it.
    """

    def __init__(self, policy: BasePolicy) -> None:
        self.policy = policy
        self._alone = False

    def act(self, seen: Observation) -> Action:
        """The actions (n, 4) that the policy thinks best.

        Torch computes with one thread from then on; `at_work` gives it back what it had.

        Args:
            seen: (n, size) of each entry.
        """
        # often: Numba sets OpenMP's number, which is torch's, when it starts its own threads
        if not self._alone or torch.get_num_threads() != 1:
            torch.set_num_threads(1)
            self._alone = True
        policy, number = self.policy, len(next(iter(seen.values())))
        actions = np.empty((number, 4), np.float32)
        block = {k: np.empty((BLOCK, *value.shape[1:]), np.float32) for k, value in seen.items()}
        asked = {key: torch.from_numpy(value) for key, value in block.items()}
        if policy.training:  # a walk through all modules, which costs as much as the network
            policy.set_training_mode(False)
        with torch.no_grad():
            for first in range(0, number, BLOCK):
                last = min(first + BLOCK, number)
                for key, value in seen.items():
                    block[key][: last - first] = value[first:last]
                    block[key][last - first :] = 0.0
                chosen = policy._predict(asked, deterministic=True)
                actions[first:last] = chosen.numpy()[: last - first]
        # as `policy.predict` does it
        return policy.unscale_action(actions) if policy.squash_output else np.clip(actions, -1, 1)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Keep torch to one thread meanwhile."""
        with one_thread():
            yield
