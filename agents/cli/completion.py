"""Shell completion of policies, planners, fields and files."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import shtab

from agents.models import shipped_agents
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.suites import SPLITS, SUITES
from planners import PLANNERS

Words = Mapping[str, Any] | str
"""Completion of an argument, by shell; shells that are missing complete nothing."""
FILE: Words = "file"
DIRECTORY: Words = "directory"


def _words(name: str, words: Iterable[str], also: str) -> Words:
    """Completion by words without special characters, and by files (`f`) or directories (`d`)."""
    choices = " ".join(words)
    files = {"f": "_files", "d": "_files -/"}.get(also, "true")
    function = f'compgen -W "{choices}" -- "$1"'
    if also:
        function += f'; compgen -{also} -- "$1"'
    return {
        "bash": name,
        "zsh": name,
        "preamble": {
            "bash": f"{name}() {{ {function}; }}",
            "zsh": f"{name}() {{ compadd -- {choices}; {files} }}",
        },
    }


_DRAWN = [f"{suite}/{split}" for suite in SUITES for split in SPLITS]
PLANNER = _words("_ferguson_planner", PLANNERS, "")
POLICY = _words("_ferguson_policy_dir", [*PLANNERS, *shipped_agents.shipped()], "d")
MODEL = _words("_ferguson_model_dir", shipped_agents.shipped(), "d")
ONE_FIELD = _words("_ferguson_field", ["paper:1", *(f"{name}:0" for name in _DRAWN)], "f")
FIELDS = _words("_ferguson_fields", ["paper:1-4", *(f"{name}:0-9" for name in _DRAWN)], "f")

LIMIT = _words("_ferguson_limit", [f"{one.name}=" for one in dataclasses.fields(Limits)], "")


def add_to(parser: argparse.ArgumentParser) -> None:
    """Add the option that prints a shell's completion script."""
    parser.add_argument(
        "--print-completion",
        choices=shtab.SUPPORTED_SHELLS,
        action=_Print,
        metavar="SHELL",
        help="print a shell script that completes commands, options and names; for "
        f"{', '.join(shtab.SUPPORTED_SHELLS)}",
    )


class _Print(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *given: Any) -> None:
        shell: str = given[1]
        sys.stdout.write(shtab.complete(parser, shell) + "\n")
        parser.exit()
