"""Arguments of the command line, checked before work starts."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from ferguson_gym.suites import LAST_SEED

Job = Callable[[], int]
"""Work whose input was checked; returns the exit status."""
DONE = 0


def seed(text: str) -> int:
    """A number from 0 on."""
    if re.fullmatch(r"[0-9]+", text) is None:
        raise argparse.ArgumentTypeError(f"a seed is a whole number from 0 on, got {text!r}")
    return _within(int(text))


def _within(number: int) -> int:
    if number > LAST_SEED:
        raise argparse.ArgumentTypeError(f"a seed is at most 2**63 - 1, got {number}")
    return number


def seeds(text: str) -> range:
    """N or A-B, B included."""
    match = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"seeds are a number or A-B, got {text!r}")
    first = int(match[1])
    last = first if match[2] is None else int(match[2])
    if first > last:
        raise argparse.ArgumentTypeError(f"empty range of seeds {text!r}: {first} is above {last}")
    return range(first, _within(last) + 1)


def positive(text: str) -> int:
    """A number from 1 on."""
    if re.fullmatch(r"[0-9]+", text) is None or int(text) < 1:
        raise argparse.ArgumentTypeError(f"need a whole number from 1 on, got {text!r}")
    return int(text)


def duration(text: str) -> float:
    """Seconds, more than none."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"need seconds, a number above 0, got {text!r}")
    return seconds


def check_directory(out: Path) -> None:
    """Refuse a place for results that is a file or below one.

    Raises:
        ValueError: it is.
    """
    for place in (out, *out.parents):
        if place.exists() and not place.is_dir():
            raise ValueError(f"--out {out}: {place} is a file, not a directory")


def refuse_twice(what: str, names: Sequence[str]) -> None:
    """Refuse names that repeat.

    Raises:
        ValueError: one does.
    """
    known: set[str] = set()
    for name in names:
        if name in known:
            raise ValueError(f"{what} {name} is named twice")
        known.add(name)
