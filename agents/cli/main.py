"""The program `ferguson`: its commands, and how it ends.

Exit status 0: done; 1: `plan` found no path, `demos` had no flight to keep; 2: bad input, or a disk
that refuses, one line on standard error; 130: interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import warnings
from collections.abc import Sequence

from agents.runtime.interrupts import defer_interrupt

BAD_INPUT, INTERRUPTED = 2, 130
_EPILOG = """\
examples:
  ferguson plan paper:2 --planner guided --plot flight.png
  ferguson evaluate --policy best --policy multi-start \\
      --fields standard/validation:0-29 --out results/thirty
  ferguson bench planners --help

{grammar}."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit status."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            return _run(arguments)
        except KeyboardInterrupt:
            _say("interrupted")
            return INTERRUPTED


def _run(arguments: Sequence[str] | None) -> int:
    with defer_interrupt():  # an interruption amid imports comes out as anything
        parser = _parser()
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files may hold what it cannot write
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = _do(parser, arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader has seen enough
        _silence_output()
        return 0
    except OSError as error:  # there is no room for what was to be read
        _silence_output()
        return _refuse(error)


def _do(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> int:
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:  # --help, --version, or a command line that was refused
        return int(stop.code or 0)
    try:
        job = options.prepare(options)
    except (ValueError, OSError) as error:
        return _refuse(error)
    try:
        status: int = job()
    except BrokenPipeError:
        raise
    except OSError as error:  # a disk, or a worker process, that refuses
        return _refuse(error)
    return status


def _refuse(error: ValueError | OSError) -> int:
    text = str(error)
    if isinstance(error, OSError) and error.strerror:  # its own text begins with a number
        text = ": ".join(str(part) for part in (error.filename, error.strerror) if part)
    from agents.cli.arguments import shortened

    _say(shortened(text))
    return BAD_INPUT


def _say(text: str) -> None:
    with contextlib.suppress(OSError):  # nobody reads it
        print(f"ferguson: {text}", file=sys.stderr)


def _silence_output() -> None:
    from agents.runtime.terminal import silence

    silence(sys.stdout)  # else the interpreter tells of it at its end


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    _say(f"warning: {' '.join(str(message).split())}")


def _parser() -> argparse.ArgumentParser:
    from agents.cli import animate, bench, completion, demos, evaluate, plan, train
    from agents.cli.arguments import Parser
    from ferguson_gym import __version__
    from ferguson_gym.world.field_names import GRAMMAR

    parser = Parser(
        prog="ferguson",
        description="Plan and evaluate flights through fields of obstacles.",
        epilog=_EPILOG.format(grammar=GRAMMAR[0].upper() + GRAMMAR[1:]),
    )
    parser.add_argument("--version", action="version", version=f"ferguson {__version__}")
    completion.add_to(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in {
        "plan": plan,
        "evaluate": evaluate,
        "animate": animate,
        "demos": demos,
        "train": train,
        "bench": bench,
    }.items():
        module.add_to(
            commands.add_parser(
                name, help=module.HELP, description=module.DESCRIPTION, epilog=module.EPILOG
            )
        )
    return parser


if __name__ == "__main__":
    sys.exit(main())
