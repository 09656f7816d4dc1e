"""A learned policy and its card, and the files that hold them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from agents.models.model_card import CARD, Card
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.settings import Settings, settings_of
from ferguson_gym.world.actions import Action

MODEL = "model.zip"


class Network(Protocol):
    """What a pilot asks."""

    def act(self, seen: Observation) -> Action:
        """The actions (n, 4) that it thinks best; of each row the same, whatever the others.

        Args:
            seen: (n, size) of each entry.
        """

    def at_work(self) -> AbstractContextManager[None]:
        """While it is asked often: what it changes in the process, it changes back at the end."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A learned policy and what is known of it."""

    network: Network
    card: Card

    @property
    def settings(self) -> Settings:
        """Of the environment it was trained in."""
        return settings_of(self.card.environment)


def directory_of(place: str | Path) -> Path:
    """The directory of a model, given by itself or by the zip in it.

    Raises:
        ValueError: there is none, or it is not whole.
    """
    given = Path(place)
    directory = given.parent if given.name == MODEL else given
    if missing := [name for name in (MODEL, CARD) if not (directory / name).is_file()]:
        raise ValueError(
            f"no model in {directory}: {' and '.join(missing)} "
            f"{'is' if len(missing) == 1 else 'are'} missing; a model is a directory with {MODEL} "
            f"and {CARD}"
        )
    return directory
