"""Arguments of the command line: how they are parsed, explained, and checked before work starts."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NoReturn

from ferguson_gym.runtime.atomic_files import unwritable
from ferguson_gym.runtime.suggestions import did_you_mean
from ferguson_gym.world.field_names import family
from ferguson_gym.world.suites import LAST_SEED

BAD_INPUT = 2
_LONG = 400
"""Characters of a message that are shown at its beginning, and at its end."""
GOES_ON = "ferguson: the same command goes on where this one stopped"
"""Printed after an interruption."""


class _Help(argparse.HelpFormatter):
    """Paragraphs are filled, lines that begin with a space stay as they are, names stay whole."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines: list[str] = []
        for kept, part in groupby(text.splitlines(), lambda line: not line or line[0] == " "):
            given = list(part)
            lines += given if kept else self._split_lines(" ".join(given), width)
        return "\n".join(indent + line for line in lines)

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)


class Parser(argparse.ArgumentParser):
    """A command, or a group of them; what it refuses it says in one line."""

    def __init__(self, *given: Any, **options: Any) -> None:
        """As its base; options have one name, and help keeps the lines of examples."""
        options.setdefault("allow_abbrev", False)
        options.setdefault("formatter_class", _Help)
        super().__init__(*given, **options)

    def error(self, message: str) -> NoReturn:
        """Say what was wrong, and where to read what would be right."""
        self.exit(BAD_INPUT, f"{self.prog}: {shortened(message)} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As its base; but a group without a command shows its help, and nothing is left over."""
        given = sys.argv[1:] if args is None else list(args)
        commands = self._commands()
        if commands is not None and not given:
            self.print_help(sys.stderr)
            self.exit(BAD_INPUT)
        namespace, rest = super().parse_known_args(given, namespace)
        if rest and commands is None:
            options = [name for action in self._actions for name in action.option_strings]
            near = did_you_mean(rest[0].partition("=")[0], options)
            self.error(f"unrecognized arguments: {' '.join(rest)}{near}")
        return namespace, rest

    def _commands(self) -> Iterable[str] | None:
        groups = (one for one in self._actions if isinstance(one, argparse._SubParsersAction))
        return next((group.choices for group in groups), None)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = ", ".join(map(str, action.choices))
            near = did_you_mean(str(value), map(str, action.choices))
            raise argparse.ArgumentError(
                action, f"invalid choice: {value!r}{near}; choose from {known}"
            )


def shortened(message: str) -> str:
    """A message in one line; where it repeats something endless, without the middle."""
    line = " ".join(message.split())
    return line if len(line) <= 2 * _LONG else f"{line[:_LONG]} ... {line[-_LONG:]}"


def add_output_options(command: argparse.ArgumentParser) -> None:
    """Give a command the options on how it speaks."""
    command.add_argument(
        "-q",
        "--quiet",
        action="store_true",
        help="tell results, warnings and errors, no progress and no notes",
    )
    command.add_argument(
        "--no-color",
        dest="colour",
        action="store_false",
        help="no colours; NO_COLOR in the environment asks for the same",
    )


def seed(text: str) -> int:
    """A number from 0 on."""
    if re.fullmatch(r"[0-9]+", text) is None:
        raise argparse.ArgumentTypeError(f"a seed is a whole number from 0 on, got {text!r}")
    return _within(text)


def _within(text: str) -> int:
    # Python reads no numbers of thousands of digits
    if len(text.lstrip("0")) > 19 or int(text) > LAST_SEED:
        raise argparse.ArgumentTypeError(f"a seed is at most 2**63 - 1, got {text}")
    return int(text)


def seeds(text: str) -> range:
    """N or A-B, B included."""
    match = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"seeds are a number or A-B, got {text!r}")
    first = _within(match[1])
    last = first if match[2] is None else _within(match[2])
    if first > last:
        raise argparse.ArgumentTypeError(f"empty range of seeds {text!r}: {first} is above {last}")
    return range(first, last + 1)


MOST_WORKERS = 1024
"""Processes, or threads, that can be asked for."""


def workers(text: str) -> int:
    """A number of processes or threads."""
    if (number := positive(text)) > MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"at most {MOST_WORKERS} of them, got {number}")
    return number


def positive(text: str) -> int:
    """A number from 1 on."""
    if re.fullmatch(r"0*[1-9][0-9]{0,17}", text) is None:
        raise argparse.ArgumentTypeError(f"need a whole number from 1 on, got {text!r}")
    return int(text)


def duration(text: str) -> float:
    """Seconds, more than none."""
    return _above_none(text, "seconds")


def minutes(text: str) -> float:
    """Minutes, more than none."""
    return _above_none(text, "minutes")


def metres(text: str) -> float:
    """A number of metres."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"need a number of metres, got {text!r}") from None


def _above_none(text: str, what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"need {what}, a number above 0, got {text!r}")
    return number


def directory(text: str) -> Path:
    """The path of a directory, there or not."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"need the path of a directory, got {text!r}")
    return Path(text)


def check_directory(out: Path) -> None:
    """Refuse a place for results that is a file or below one, or where nothing can be written.

    Raises:
        ValueError: it is.
        OSError: a name that cannot be one, as it is too long.
    """
    for place in (out, *out.parents):
        if os.path.lexists(place) and not place.is_dir():
            raise ValueError(f"--out {out}: {place} is a file, not a directory")
        if place.is_dir():
            if (reason := unwritable(place)) is not None:
                raise ValueError(f"--out {out}: cannot write in {place.resolve()}: {reason}")
            for part in out.relative_to(place).parts:
                (place / part).exists()  # raises if no file system could have it
            return


def check_number(
    specs: Sequence[str], most: int, seeds: range = range(1), policies: int = 1
) -> None:
    """Refuse more flights than anybody can mean, before a list of them is made.

    Args:
        specs: of fields.
        most: flights.
        seeds: with each of which every policy flies every field.
        policies: number of them.

    Raises:
        ValueError: there are more.
    """
    fields = sum(_size(_numbers(spec)) for spec in specs)
    if (flights := fields * _size(seeds) * policies) > most:
        raise ValueError(
            f"at most {most} flights can be asked for at once, got {flights}: fields "
            f"{', '.join(specs)}, {_size(seeds)} x seeds, {policies} x policies"
        )


def _size(numbers: range) -> int:
    return numbers.stop - numbers.start  # a length may be too great for len()


def _numbers(spec: str) -> range:
    try:
        return family(spec)[1]
    except ValueError:  # files, which nobody has so many of, or what is refused elsewhere
        return range(1)


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
