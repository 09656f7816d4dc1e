"""Where learned agents lie: those shipped with the package, by name, and trained ones, by path.

Names are checked without torch, and most agents fly without it.
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

from agents.models import loading
from agents.models.model import MODEL
from agents.models.model_card import CARD
from ferguson_gym.runtime.optional_dependencies import installing

SHIPPED = Path(__file__).parent / "shipped"
"""A directory with `model.zip` and `model.json` for each shipped agent."""
BEST = "best"
"""Another name for the best of them; `best.json` there says which it is, options included."""
_FILES = (MODEL, CARD)


def shipped() -> dict[str, Path]:
    """Directories of the shipped agents by name, `best` among them if there are any."""
    agents = {path.name: path for path in sorted(SHIPPED.iterdir()) if path.is_dir()}
    agents = {name: path for name, path in agents.items() if (path / _FILES[0]).exists()}
    if (plain := (best() or BEST).partition("+")[0]) in agents:
        agents[BEST] = agents[plain]
    return agents


def best() -> str | None:
    """The policy name of the best shipped agent, options included; None if no file names it.

    Raises:
        ValueError: the file that names it is damaged.
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


def find(name: str) -> Path | None:
    """The directory of the agent of this name or at this path; None if there is none.

    A directory with one of a model's two files counts: what is missing is said when it is loaded.

    Raises:
        ValueError: there is one, and what it needs is not installed.
    """
    place = shipped().get(name) or _at(Path(name))
    if place is not None and _needs_torch(place):
        need(f"agent {name!r}")
    return place


def _needs_torch(place: Path) -> bool:
    try:
        return loading.needs_torch(place)
    except ValueError:  # which is said when it is loaded
        return False


def _at(path: Path) -> Path | None:
    try:
        directory = path.parent if path.name in _FILES and path.is_file() else path
        return directory if any((directory / file).is_file() for file in _FILES) else None
    except (OSError, ValueError):  # a name that is none of a file
        return None


def need(what: str, *modules: str) -> None:
    """See that the libraries are there that agents learn with, without importing them.

    Raises:
        ValueError: one is not installed.
    """
    for module in ("torch", "stable_baselines3", "sb3_contrib", *modules):
        if importlib.util.find_spec(module) is None:
            raise ValueError(f"{what} needs {module}: {installing('agents')}")
