"""`Model`: a network and its card; and the directory that holds them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from agents.models.model_card import CARD, ModelCard
from ferguson_gym.simulation import Observation, Settings, settings_of
from ferguson_gym.world import Action

MODEL = "model.zip"


class Network(Protocol):
    """Maps observations to actions."""

    def act(self, observation: Observation) -> Action:
        """Deterministic actions (n, 4); a row's action does not depend on the other rows.

        Args:
            observation: entries of shape (n, size).
        """

    def session(self) -> AbstractContextManager[None]:
        """Context for many calls of `act`; process-wide settings are restored at its end."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A learned policy: its network and its card."""

    network: Network
    card: ModelCard

    @property
    def settings(self) -> Settings:
        """Settings of the environment in which the model was trained."""
        return settings_of(self.card.environment)


def directory_of(place: str | Path) -> Path:
    """The directory of a model, given as the directory or as the `model.zip` in it.

    Raises:
        ValueError: One or both of the model's files are missing.
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
