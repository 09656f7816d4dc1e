"""Arguments that several commands share, each with its help text and its completion."""

from __future__ import annotations

import argparse
from typing import Any

from agents.cli.arguments import directory, positive, seed, workers
from agents.cli.completion import DIRECTORY, FIELDS, ONE_FIELD, PLANNER, completes
from ferguson_gym.simulation.observations import KINDS
from planners.registry import OPTIONS, PLANNERS

RESUME_NOTE = "ferguson: run the same command again to resume"
"""Printed when a command that can be resumed is interrupted."""


def add_field(command: argparse.ArgumentParser) -> None:
    """Add the positional argument that names one field."""
    command_help = "for example paper:1, standard/test:7 or my_field.json"
    completes(command.add_argument("field", metavar="FIELD", help=command_help), ONE_FIELD)


def add_fields(command: argparse.ArgumentParser, text: str, *, required: bool = True) -> None:
    """Add `--fields`, which may be repeated.

    Args:
        command: that gets the option.
        text: its help text, before the note that it may be repeated.
        required: whether it must be given.
    """
    argument = command.add_argument(
        "--fields",
        action="append",
        required=required,
        metavar="SPEC",
        help=f"{text}; may be given several times",
    )
    completes(argument, FIELDS)


def add_planner(command: argparse.ArgumentParser, option: str, **settings: Any) -> None:
    """Add an option that takes a planner's name."""
    names = ", ".join(PLANNERS)
    settings.setdefault("help", f"a planner: {names}; options: {OPTIONS}")
    completes(command.add_argument(option, metavar="NAME", **settings), PLANNER)


def add_out(
    command: argparse.ArgumentParser, text: str = "directory of the results", required: bool = True
) -> None:
    """Add `--out` for a directory."""
    argument = command.add_argument(
        "--out", type=directory, required=required, metavar="DIR", help=text
    )
    completes(argument, DIRECTORY)


def add_observation(command: argparse.ArgumentParser) -> None:
    """Add `--observation`, the kind of observation."""
    command.add_argument(
        "--observation",
        choices=KINDS,
        default=KINDS[0],
        metavar="KIND",
        help=f"kind of observation: {', '.join(KINDS)}; default: %(default)s",
    )


def add_seed(command: argparse.ArgumentParser, text: str) -> None:
    """Add `--seed`; the text says what is seeded."""
    command.add_argument("--seed", type=seed, default=0, metavar="N", help=f"{text}; default: 0")


def add_workers(command: argparse.ArgumentParser, text: str = "number of worker processes") -> None:
    """Add `--workers`, one by default."""
    command.add_argument(
        "--workers", type=workers, default=1, metavar="N", help=f"{text}; default: 1"
    )


def add_count(command: argparse.ArgumentParser, option: str, default: int, text: str) -> None:
    """Add an option that takes a number from 1."""
    command.add_argument(
        option, type=positive, default=default, metavar="N", help=f"{text}; default: {default}"
    )


def add_json(
    command: argparse.ArgumentParser, text: str = "print only the object of summary.json"
) -> None:
    """Add `--json`."""
    command.add_argument("--json", action="store_true", help=text)


def add_output_options(command: argparse.ArgumentParser) -> None:
    """Add the options on how much a command prints, and whether in colour."""
    command.add_argument(
        "-q",
        "--quiet",
        action="store_true",
        help="print only results, warnings and errors: no progress and no notes",
    )
    command.add_argument(
        "--no-color",
        dest="colour",
        action="store_false",
        help="print without colours; so does NO_COLOR in the environment",
    )
