"""The argument parser, the types of arguments, and checks before work starts."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
import textwrap
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NoReturn

from ferguson_gym.runtime import did_you_mean
from ferguson_gym.runtime.atomic_files import unwritable
from ferguson_gym.world.field_names import family
from ferguson_gym.world.limits import check_names
from ferguson_gym.world.suites import LAST_SEED

BAD_INPUT = 2
_LONG = 400
"""Characters shown of the beginning and of the end of a message that is too long."""


class _Help(argparse.HelpFormatter):
    """Fills paragraphs, keeps lines that begin with a space, and breaks no word at a hyphen."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines: list[str] = []
        for kept, part in groupby(text.splitlines(), lambda line: not line or line[0] == " "):
            given = list(part)
            lines += given if kept else self._split_lines(" ".join(given), width)
        return "\n".join(indent + line for line in lines)

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)


class Parser(argparse.ArgumentParser):
    """The parser of a command or of a group of commands; its errors are one line."""

    def __init__(self, *given: Any, **options: Any) -> None:
        """As the base class, without abbreviated options, and with examples kept in help texts."""
        options.setdefault("allow_abbrev", False)
        options.setdefault("formatter_class", _Help)
        super().__init__(*given, **options)

    def add_argument(self, *names: Any, complete: Any = None, **settings: Any) -> argparse.Action:
        """As the base class; `complete` is the argument's completion (`agents.cli.completion`)."""
        action = super().add_argument(*names, **settings)
        if complete is not None:
            action.complete = complete  # type: ignore[attr-defined]
        return action

    def error(self, message: str) -> NoReturn:
        """Exit with a message and a pointer to the help text."""
        self.exit(BAD_INPUT, f"{self.prog}: {truncate_message(message)} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As the base class, but unknown arguments are an error of the command itself.

        A group without a command prints its help.
        """
        given = sys.argv[1:] if args is None else list(args)
        groups = (one for one in self._actions if isinstance(one, argparse._SubParsersAction))
        commands = next((group.choices for group in groups), None)
        if commands is not None and not given:
            self.print_help(sys.stderr)
            self.exit(BAD_INPUT)
        namespace, rest = super().parse_known_args(given, namespace)
        if rest and commands is None:
            options = [name for action in self._actions for name in action.option_strings]
            near = did_you_mean(rest[0].partition("=")[0], options)
            self.error(f"unrecognized arguments: {' '.join(rest)}{near}")
        return namespace, rest

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = ", ".join(map(str, action.choices))
            near = did_you_mean(str(value), map(str, action.choices))
            raise argparse.ArgumentError(
                action, f"invalid choice: {value!r}{near}; choose from {known}"
            )


def truncate_message(message: str) -> str:
    """A message as one line, without its middle if it is too long."""
    line = " ".join(message.split())
    return line if len(line) <= 2 * _LONG else f"{line[:_LONG]} ... {line[-_LONG:]}"


def seed(text: str) -> int:
    """An integer >= 0."""
    if re.fullmatch(r"[0-9]+", text) is None:
        raise argparse.ArgumentTypeError(f"a seed is an integer >= 0, got {text!r}")
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
"""Upper limit of the number of processes or threads."""


def workers(text: str) -> int:
    """A number of processes or threads."""
    if (number := positive(text)) > MOST_WORKERS:
        raise argparse.ArgumentTypeError(
            f"at most {MOST_WORKERS} processes or threads, got {number}"
        )
    return number


def positive(text: str) -> int:
    """An integer >= 1."""
    if re.fullmatch(r"0*[1-9][0-9]{0,17}", text) is None:
        raise argparse.ArgumentTypeError(f"need an integer >= 1, got {text!r}")
    return int(text)


def duration(text: str) -> float:
    """A positive number of seconds."""
    return _above_zero(text, "seconds")


def minutes(text: str) -> float:
    """A positive number of minutes."""
    return _above_zero(text, "minutes")


def metres(text: str) -> float:
    """A number of metres."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"need a number of metres, got {text!r}") from None


def limit(text: str) -> tuple[str, float]:
    """NAME=VALUE of a field's limit."""
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(
            f"a limit is NAME=VALUE, for example longest=30, got {text!r}"
        )
    try:
        check_names([name])
        return name, float(value)
    except ValueError as error:
        known = str(error).startswith("unknown limit")
        raise argparse.ArgumentTypeError(
            str(error) if known else f"limit {name} is a number, got {value!r}"
        ) from None


def spacing(text: str) -> float:
    """A positive number of metres."""
    return _above_zero(text, "metres")


def _above_zero(text: str, what: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"need a positive number of {what}, got {text!r}")
    return number


def directory(text: str) -> Path:
    """The path of a directory, which need not exist."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"need the path of a directory, got {text!r}")
    return Path(text)


def check_directory(out: Path) -> None:
    """Check that a directory of results exists or can be made, and can be written to.

    Raises:
        ValueError: the path is that of a file or below one, or cannot be written to.
        OSError: the file system allows no such name, for example a longer one than it can hold.
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
    """Check the number of flights before a list of them is made.

    Raises:
        ValueError: fields (names, ranges included) x policy seeds x policies are more than `most`.
    """
    fields = sum(map(_number_of_fields, specs))
    if (flights := fields * _size(seeds) * policies) > most:
        raise ValueError(
            f"at most {most} flights can be requested at once, got {flights}: {fields} fields "
            f"({', '.join(specs)}) x {_size(seeds)} seeds x {policies} policies"
        )


def _size(numbers: range) -> int:
    return numbers.stop - numbers.start  # the length may be too great for len()


def _number_of_fields(spec: str) -> int:
    try:
        return _size(family(spec)[1])
    except ValueError:  # files, or names that are refused elsewhere
        return 1


def refuse_twice(what: str, names: Sequence[str]) -> None:
    """Check that no name is repeated.

    Raises:
        ValueError: a name is repeated.
    """
    known: set[str] = set()
    for name in names:
        if name in known:
            raise ValueError(f"{what} {name} is given twice")
        known.add(name)
