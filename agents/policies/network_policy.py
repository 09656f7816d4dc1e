"""Learned policies that fly in any environment, one flight at a time."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from agents.models import loading, model_card
from agents.models.model import MODEL, Model
from agents.runtime.kernels import small_field
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.observe import observe
from ferguson_gym.world import transition
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field


class NetworkPolicy:
    """A model as a policy (`agents.policies.interface.Policy`); it flies what it thinks best.

    It sees what it was trained to see, whatever the environment shows, and flies the very
    flights that `agents.flights.batched.fly_batch` does. A model of torch keeps it to one thread
    for good.
    """

    def __init__(self, model: Model) -> None:
        self.model, self._settings = model, model.settings

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field; the seed changes nothing."""
        self._field = field

    def act(self, observation: Observation, vehicle: transition.State) -> Action:
        """The next action (4,)."""
        seen = observe(self._field, [vehicle], self._settings)
        action: Action = self.model.network.act(seen)[0]
        return action


def network_policy(directory: Path) -> NetworkPolicy:
    """The pilot whose model lies in a directory; loaded once in a process, and ready to fly.

    Raises:
        ValueError: as `agents.models.loading.load`.
    """
    files = [directory / name for name in (MODEL, model_card.CARD)]
    return NetworkPolicy(_ready(directory.resolve(), *(_stamp(file) for file in files)))


def _stamp(file: Path) -> tuple[int, int]:
    """Differs when a file was rewritten; nothing where there is none."""
    try:
        status = file.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _ready(directory: Path, *_: tuple[int, int]) -> Model:
    model = loading.load(directory)
    first = NetworkPolicy(model)  # what is slow the first time is not timed in a flight
    first.begin(small_field(), 0)
    first.act({}, transition.initial_state(small_field()))
    return model
