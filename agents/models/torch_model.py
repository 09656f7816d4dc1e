"""Models in torch: built, saved, loaded for training, and evaluated if no kernels exist."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor

from agents.models import networks, weights
from agents.models.architecture import architecture_of
from agents.models.inference.activations import Float32Array
from agents.models.inference.forward import CompiledNetwork
from agents.models.model import MODEL, Model, directory_of
from agents.models.model_card import CARD, ModelCard, read_card, write_card
from ferguson_gym.runtime import atomic_write
from ferguson_gym.simulation import Observation, settings_of
from ferguson_gym.spaces import action_space, observation_space
from ferguson_gym.world import Action

BLOCK = 16
"""Batch size of every forward pass in flight."""
_PICKLED = "policy.pth"
"""Entry of the zip with the weights as Stable-Baselines3 saves them."""
MAX_WIDTH, MAX_LAYERS = 8192, 64
"""Limits on the networks that are built, since a card may ask for any size."""
_NOT_DATA = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf", "ep_info_buffer")
"""Attributes left out of the zip: schedules and buffers of a finished training."""


@dataclass(frozen=True, slots=True, eq=False)
class TorchModel:
    """A policy of Stable-Baselines3, critic included, and its card."""

    policy: BasePolicy
    """Its weights are on the CPU."""
    card: ModelCard

    @property
    def weights(self) -> dict[str, Float32Array]:
        """Weights by name, sharing the policy's memory; tied weights appear once."""
        return {name: value.numpy() for name, value in _distinct(self.policy).items()}

    @property
    def model(self) -> Model:
        """The model for flight; compiled kernels get a copy of the current weights."""
        if (architecture := architecture_of(self.card)) is None:
            return Model(TorchNetwork(self.policy), self.card)
        return Model(CompiledNetwork(architecture, self.weights), self.card)


def _distinct(policy: BasePolicy) -> dict[str, Tensor]:
    """Weights under the first of their names; actor and critic may share some."""
    found: dict[int, tuple[str, Tensor]] = {}
    for name, value in policy.state_dict().items():
        found.setdefault(value.data_ptr(), (name, value))
    return dict(found.values())


def build(card: ModelCard, where: str = "") -> BasePolicy:
    """Build the network that a card describes, with random weights.

    Raises:
        ValueError: The card describes no valid network; `where` begins the message.
    """
    try:
        _check_sizes(card.policy_kwargs)
        kind = networks.policy_class(card.algorithm, card.policy)
        kwargs = networks.sb3_policy_kwargs(card.policy, card.policy_kwargs)
        observation = observation_space(settings_of(card.environment))
        return kind(observation, action_space(), lambda _: 0.0, **kwargs)
    except (ValueError, TypeError, AssertionError, RuntimeError, KeyError) as error:
        raise ValueError(f"{where}{_first_line(error)}") from None


def _check_sizes(given: object) -> None:
    """Refuse networks that would exhaust the memory or take hours to initialise."""
    if isinstance(given, Mapping):
        given = list(given.values())
    if isinstance(given, (list, tuple)):
        if len(given) > MAX_LAYERS:
            raise ValueError(f"at most {MAX_LAYERS} layers, got {len(given)}")
        for entry in given:
            _check_sizes(entry)
    elif isinstance(given, int) and given > MAX_WIDTH:
        raise ValueError(f"layers of at most {MAX_WIDTH} units, got {given}")


def save(directory: Path, model: BaseAlgorithm, card: ModelCard) -> None:
    """Write a model into an existing directory; each file is written atomically.

    `model.zip` is the zip of Stable-Baselines3, from which training can resume. The weights are
    added to it as arrays, which flights read without torch.

    Raises:
        ValueError: The card describes another network, or has a number that is not finite; nothing
            is written.
    """
    card.to_json()  # raises before anything is written
    _check_described(model.policy, card)
    with atomic_write(directory / MODEL) as temporary:
        model.save(temporary, exclude=_NOT_DATA)
        with zipfile.ZipFile(temporary, "a") as archive:
            weights.write(archive, TorchModel(model.policy, card).weights)
    write_card(directory, card)


def _check_described(policy: BasePolicy, card: ModelCard) -> None:
    """Check that the network that a card describes flies as a policy does.

    Raises:
        ValueError: The card describes no network or another one.
    """
    with torch.random.fork_rng(devices=[]):  # a training goes on with the same random numbers
        described = build(card, "the card describes no network: ")
    found, expected = _shapes(policy), _shapes(described)
    if policy.observation_space != described.observation_space:
        why = "it has other observations"
    elif found != expected:
        name = sorted(name for name, _ in found.items() ^ expected.items())[0]
        why = f"the shape of {name} is {found.get(name)} and should be {expected.get(name)}"
    elif not _acts_alike(policy, described):
        why = "with the same weights it chooses other actions"
    else:
        return
    raise ValueError(
        f"the card describes another network, of policy {card.policy!r}: {why}; make the model "
        "with policy_class and sb3_policy_kwargs of agents.models.networks, or correct the card"
    )


def _shapes(policy: BasePolicy) -> dict[str, tuple[int, ...]]:
    return {name: tuple(value.shape) for name, value in policy.state_dict().items()}


def _acts_alike(policy: BasePolicy, described: BasePolicy) -> bool:
    """Whether two policies choose the same actions once they have the same weights."""
    described.load_state_dict(policy.state_dict())
    described.observation_space.seed(0)
    samples = [described.observation_space.sample() for _ in range(BLOCK)]
    seen = {key: torch.as_tensor(np.stack([one[key] for one in samples])) for key in samples[0]}
    chosen = []
    for one in (policy, described):
        training = one.training
        one.set_training_mode(False)
        with torch.no_grad():
            chosen.append(one._predict(seen, deterministic=True))
        one.set_training_mode(training)
    mine, theirs = chosen
    return torch.allclose(mine, theirs, rtol=1e-4, atol=1e-5, equal_nan=True)


def export(source: Path, directory: Path) -> None:
    """Copy a model's weights and card without the state of its training, as agents are shipped.

    Raises:
        ValueError: As `load`.
    """
    learned = load(source)
    directory.mkdir(parents=True, exist_ok=True)
    with atomic_write(directory / MODEL) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        weights.write(archive, learned.weights)
    write_card(directory, learned.card)


def load(place: str | Path) -> TorchModel:
    """Load a policy in torch, given its directory or `model.zip`, to train it further or to fly it.

    Raises:
        ValueError: As `agents.models.loading.load`.
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
        _load_state(policy, _read_state(path), path)
    policy.set_training_mode(False)
    return TorchModel(policy, card)


def _load_state(policy: BasePolicy, given: Mapping[str, Tensor], path: Path) -> None:
    """Load weights into a policy; raises ValueError if they do not fit it or are not finite."""
    try:
        policy.load_state_dict(given)
    except (RuntimeError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{path}: its weights are not those of the network that {CARD} describes "
            f"({_first_line(error)})"
        ) from None
    if not all(torch.isfinite(weight).all() for weight in policy.state_dict().values()):
        raise ValueError(f"{path}: weights that are not finite")


def _read_state(path: Path) -> dict[str, Tensor]:
    """Weights of a model saved without arrays, read by torch's loader of weights alone."""
    try:
        with zipfile.ZipFile(path) as archive:
            size, most = archive.getinfo(_PICKLED).file_size, 4 * weights.MAX_WEIGHTS
            if size > most:
                raise ValueError(f"{path}: {size:,} bytes of weights; at most {most:,}")
            # read at once: torch seeks back and forth, and each seek would unpack from the start
            file = io.BytesIO(archive.read(_PICKLED))
    except KeyError:
        text = f"{path}: no weights in it: cut short, or not saved by this package"
        raise ValueError(text) from None
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError):
        raise ValueError(f"{path}: not a zip file, or damaged") from None
    try:
        read = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # torch documents no types of error
        raise ValueError(
            f"{path}: {_PICKLED} does not hold weights alone, and nothing else is read "
            f"({type(error).__name__})"
        ) from None
    if not isinstance(read, dict):
        raise ValueError(f"{path}: {_PICKLED} does not hold weights")
    return read


def _first_line(error: BaseException) -> str:
    """The informative line of a library's message, which may be long."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[1] if len(lines) > 1 and lines[0].endswith(":") else " ".join(lines[:1])


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread within the block.

    Use it around many steps, not each one: threads that are woken up spin before they sleep.
    """
    before = torch.get_num_threads()
    # also where the count is one: that is OpenMP's, and the BLAS library has its own
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class TorchNetwork:
    """A torch policy as an `agents.models.model.Network`.

    The last bit of a matrix product may depend on the number of rows. Forward passes therefore
    always have `BLOCK` rows, padded with zeros, and one thread: an action then does not depend on
    the other rows.
    """

    def __init__(self, policy: BasePolicy) -> None:
        self.policy = policy
        self._one_thread_set = False

    def act(self, observation: Observation) -> Action:
        """Deterministic actions (n, 4) of entries (n, size), each independent of other rows.

        Torch keeps one thread afterwards; `session` restores the previous number.
        """
        # checked at each call: Numba resets OpenMP's number, which is torch's, with its own threads
        if not self._one_thread_set or torch.get_num_threads() != 1:
            torch.set_num_threads(1)
            self._one_thread_set = True
        policy, number = self.policy, len(next(iter(observation.values())))
        actions = np.empty((number, 4), np.float32)
        shapes = {key: (BLOCK, *value.shape[1:]) for key, value in observation.items()}
        block = {key: np.empty(shape, np.float32) for key, shape in shapes.items()}
        asked = {key: torch.from_numpy(value) for key, value in block.items()}
        if policy.training:  # the call visits all modules and costs as much as a pass
            policy.set_training_mode(False)
        with torch.no_grad():
            for first in range(0, number, BLOCK):
                last = min(first + BLOCK, number)
                for key, value in observation.items():
                    block[key][: last - first] = value[first:last]
                    block[key][last - first :] = 0.0
                chosen = policy._predict(asked, deterministic=True)
                actions[first:last] = chosen.numpy()[: last - first]
        # as in `policy.predict`
        return policy.unscale_action(actions) if policy.squash_output else np.clip(actions, -1, 1)

    def session(self) -> AbstractContextManager[None]:
        """Limit torch to one thread within the block."""
        return one_thread()
