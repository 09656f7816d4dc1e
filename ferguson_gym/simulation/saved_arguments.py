"""Arguments of the environment in files, which outlive a default.

The default observation was once `discs` and is now `rays`. Files therefore name their observation,
and a file that does not is from the time of the first default.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ferguson_gym.simulation.settings import Settings

_FIRST_DEFAULT = "discs"


def arguments_to_save(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments for a file: they name the observation, also where it is the default."""
    return {"observation": Settings().observation, **arguments}


def saved_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments read from a file; without an observation they are from when it was `discs`."""
    return {"observation": _FIRST_DEFAULT, **arguments}
