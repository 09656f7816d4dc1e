"""Find learned agents: shipped ones by name, trained ones by path. Needs no torch."""

from __future__ import annotations

import importlib.util
import json
from contextlib import suppress
from pathlib import Path

from agents.models import loading
from agents.models.model import MODEL
from agents.models.model_card import CARD
from ferguson_gym.runtime.optional_dependencies import installing

SHIPPED = Path(__file__).parent / "shipped"
"""Holds a directory with `model.zip` and `model.json` for each shipped agent."""
BEST = "best"
"""Alias of the best shipped agent; `best.json` names it, options included."""
_FILES = (MODEL, CARD)


def shipped() -> dict[str, Path]:
    """Directories of the shipped agents by name; `best` is one of the names."""
    agents = {path.name: path for path in sorted(SHIPPED.iterdir()) if (path / MODEL).exists()}
    if (plain := (best() or BEST).partition("+")[0]) in agents:
        agents[BEST] = agents[plain]
    return agents


def best() -> str | None:
    """The policy name of the best shipped agent, options included; None if no file names it.

    Raises:
        ValueError: The file that names it is damaged.
    """
    file = SHIPPED / f"{BEST}.json"
    if not file.exists():
        return None
    try:
        known = json.loads(file.read_text(encoding="utf-8"))[BEST]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        known = None
    if not isinstance(known, str) or known.partition("+")[0] == BEST:
        raise ValueError(f"{file} is damaged: it does not say which agent is best; install again")
    return known


def find_agent(name: str) -> Path | None:
    """The directory of the agent with this name or at this path; None if there is no such agent.

    One of a model's two files is enough here; loading reports the missing one.

    Raises:
        ValueError: The agent needs a library that is not installed.
    """
    place = shipped().get(name) or _at(Path(name))
    needs_torch = False
    if place is not None:
        with suppress(ValueError):  # loading reports it
            needs_torch = loading.needs_torch(place)
    if needs_torch:
        require_libraries(f"agent {name!r}")
    return place


def _at(path: Path) -> Path | None:
    try:
        directory = path.parent if path.name in _FILES and path.is_file() else path
        return directory if any((directory / file).is_file() for file in _FILES) else None
    except (OSError, ValueError):  # not a possible file name
        return None


def require_libraries(what: str, *modules: str) -> None:
    """Check that the libraries for training are installed, without importing them.

    Raises:
        ValueError: One of them, or of the further modules, is missing; `what` needs it.
    """
    for module in ("torch", "stable_baselines3", "sb3_contrib", *modules):
        if importlib.util.find_spec(module) is None:
            raise ValueError(f"{what} needs {module}: {installing('agents')}")
