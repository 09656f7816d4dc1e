"""Arguments that several commands share, each with its help text and its completion."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from agents.cli.arguments import Parser, directory, limit, metres, positive, seed, seeds, workers
from agents.cli.completion import DIRECTORY, FIELDS, LIMIT, ONE_FIELD, PLANNER
from agents.runtime.terminal import Terminal
from ferguson_gym.simulation.observations import KINDS
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world import Field, Limits
from planners.registry import OPTIONS, PLANNERS

if TYPE_CHECKING:
    from agents.flights.field_changes import FieldChanges

RESUME_NOTE = "ferguson: run the same command again to resume"
"""Printed when a command that can be resumed is interrupted."""


def add_field(command: Parser) -> None:
    """Add the positional argument that names one field."""
    text = "for example paper:1, standard/test:7 or my_field.json"
    command.add_argument("field", metavar="FIELD", help=text, complete=ONE_FIELD)


def add_fields(command: Parser, text: str, *, required: bool = True) -> None:
    """Add `--fields`, which may be repeated; the help text says so at its end."""
    command.add_argument(
        "--fields",
        action="append",
        required=required,
        metavar="SPEC",
        help=f"{text}; may be given several times",
        complete=FIELDS,
    )


def add_field_changes(command: Parser) -> None:
    """Add `--inflate` and `--limit`; `field_changes` reads them."""
    command.add_argument(
        "--inflate",
        type=metres,
        default=0.0,
        metavar="METRES",
        help="grow all obstacles by the vehicle's radius, for planners and shortest paths alike; "
        "default: 0",
    )
    add_limits(
        command,
        "change a limit of all fields: {names}; another longest also scales shortest, slowest, "
        "gate and tolerance; may be given several times; default: the fields' own limits",
    )


def add_limits(command: Parser, text: str) -> None:
    """Add `--limit`; its help text has the names of limits where it says `{names}`."""
    names = ", ".join(one.name for one in dataclasses.fields(Limits))
    command.add_argument(
        "--limit",
        type=limit,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=text.format(names=names),
        complete=LIMIT,
    )


def field_changes(options: argparse.Namespace) -> FieldChanges:
    """The changes that options ask for.

    Raises:
        ValueError: as `FieldChanges`.
    """
    from agents.flights.field_changes import FieldChanges

    return FieldChanges(inflate=options.inflate, limits=tuple(options.limit))


def note_touching(fields: Iterable[Field], terminal: Terminal) -> None:
    """Note that obstacles of some fields touch, if so: paths slip between them."""
    from ferguson_gym.world.touching import touching_pairs

    found = [(field.name, number) for field in fields if (number := len(touching_pairs(field)))]
    if not found:
        return
    name, number = found[0]
    pairs = "1 pair of obstacles touches" if number == 1 else f"{number} pairs of obstacles touch"
    others = f", and in {len(found) - 1} other fields likewise" if len(found) > 1 else ""
    terminal.note(
        f"note: in {name} {pairs} without overlapping{others}, and paths may pass between them; "
        "--inflate METRES, the vehicle's radius, closes such gaps"
    )


def add_planner(command: Parser, option: str, **settings: Any) -> None:
    """Add an option that takes a planner's name."""
    names = ", ".join(PLANNERS)
    settings.setdefault("help", f"a planner: {names}; options: {OPTIONS}")
    command.add_argument(option, metavar="NAME", complete=PLANNER, **settings)


def add_out(command: Parser, text: str = "directory of the results", required: bool = True) -> None:
    """Add `--out` for a directory."""
    command.add_argument(
        "--out", type=directory, required=required, metavar="DIR", help=text, complete=DIRECTORY
    )


def add_observation(command: Parser) -> None:
    """Add `--observation`, the kind of observation."""
    command.add_argument(
        "--observation",
        choices=KINDS,
        default=Settings().observation,
        metavar="KIND",
        help=f"kind of observation, {', '.join(KINDS)}: the nearest obstacles, ranges along rays, "
        "or both; default: %(default)s",
    )


def add_seed(command: Parser, text: str) -> None:
    """Add `--seed`; the text says what is seeded."""
    command.add_argument("--seed", type=seed, default=0, metavar="N", help=f"{text}; default: 0")


def add_seeds(command: Parser, text: str) -> None:
    """Add `--seeds`; the text says what is seeded."""
    command.add_argument(
        "--seeds", type=seeds, default=range(1), metavar="N|A-B", help=f"{text}; default: 0"
    )


def add_workers(command: Parser, text: str = "number of worker processes") -> None:
    """Add `--workers`, one by default."""
    command.add_argument(
        "--workers", type=workers, default=1, metavar="N", help=f"{text}; default: 1"
    )


def add_count(command: Parser, option: str, default: int, text: str) -> None:
    """Add an option that takes a number from 1."""
    command.add_argument(
        option, type=positive, default=default, metavar="N", help=f"{text}; default: {default}"
    )


def add_json(
    command: Parser, text: str = "print the content of summary.json instead of tables"
) -> None:
    """Add `--json`."""
    command.add_argument("--json", action="store_true", help=text)


def add_output_options(command: Parser) -> None:
    """Add the options on how much a command prints, and whether in colour."""
    command.add_argument(
        *("-q", "--quiet"),
        action="store_true",
        help="print only results, warnings and errors: no progress and no notes",
    )
    command.add_argument(
        "--no-color",
        dest="colour",
        action="store_false",
        help="disable colours, as does setting the variable NO_COLOR",
    )


def make_terminal(options: argparse.Namespace) -> Terminal:
    """The output of a command, as its options ask for."""
    as_json = getattr(options, "json", False)  # not every command has it
    return Terminal(quiet=options.quiet, colour=options.colour, as_json=as_json)
