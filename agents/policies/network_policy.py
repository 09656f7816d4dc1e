"""Learned policies, one flight at a time."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from agents.models import loading, model_card
from agents.models.model import MODEL, Model
from agents.runtime.kernels import small_field
from ferguson_gym.simulation import Observation, SimulatedRollouts, observe
from ferguson_gym.world import Action, Field, transition
from planners.interface import Knowledge


class NetworkPolicy:
    """A model as a policy (`agents.policies.interface.Policy`) that flies its most likely action.

    It writes its own observations with the settings that it was trained with, whatever the
    environment returns, and flies exactly the flights of `agents.flights.batched.fly_batch`. A
    torch model limits torch to one thread for the rest of the process.
    """

    def __init__(self, model: Model) -> None:
        self.model, self._settings = model, model.settings

    @property
    def knows(self) -> Knowledge:
        """What its observation shows of a field."""
        return self.model.card.knows

    def begin(self, field: Field, seed: int) -> None:
        """Start a flight through a field; the seed changes nothing."""
        self._field = field

    def act(self, observation: Observation, vehicle: transition.State) -> Action:
        """The next action (4,)."""
        seen = observe(self._field, [vehicle], self._settings)
        action: Action = self.model.network.act(seen)[0]
        return action


def network_policy(directory: Path) -> NetworkPolicy:
    """The policy of the model in a directory, loaded and compiled once in a process.

    Raises:
        ValueError: as `agents.models.loading.load`.
    """
    files = [directory / name for name in (MODEL, model_card.CARD)]
    return NetworkPolicy(_ready(directory.resolve(), *(_stamp(file) for file in files)))


def _stamp(file: Path) -> tuple[int, int]:
    """Time of the last change [ns] and size of a file; zeros if there is none."""
    with suppress(OSError):
        return (status := file.stat()).st_mtime_ns, status.st_size
    return 0, 0


@lru_cache(maxsize=8)
def _ready(directory: Path, *_: tuple[int, int]) -> Model:
    model = loading.load(directory)
    first = NetworkPolicy(model)  # compiles, so that the first flight is not slower
    field, vehicle = small_field(), transition.initial_state(small_field())
    first.begin(field, 0)
    first.act({}, vehicle)
    SimulatedRollouts([field], [0], [vehicle], model.settings)  # as batches and lookahead observe
    return model
