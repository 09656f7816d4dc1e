"""The program `ferguson`: its commands and its exit status.

Exit status 0: done; 1: `plan` found no path, or `demos` had no successful flight; 2: bad input or
a failing disk, with one line on standard error; 130: interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from agents.runtime.interrupts import defer_interrupt
from agents.runtime.jobs import DONE, Job

if TYPE_CHECKING:
    from agents.runtime.terminal import Terminal

BAD_INPUT, INTERRUPTED = 2, 130
_RESUMABLE = ("demos", "evaluate", "train")
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
    with defer_interrupt():  # an interruption during imports may surface as any error
        parser = _parser()
    # file names may hold characters that it cannot encode
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = _do(parser, arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader closed the pipe
        _silence_output()
        return 0
    except OSError as error:  # standard output cannot be written, for example on a full disk
        _silence_output()
        return _report(error)


def _do(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> int:
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:  # --help, --version, or a command line that was refused
        return int(stop.code or 0)
    from agents.cli.compile_notice import announce_compilation
    from agents.cli.shared_options import make_terminal

    terminal = make_terminal(options)
    with announce_compilation(terminal, _warn):
        return _prepare_and_do(options, terminal)


def _prepare_and_do(options: argparse.Namespace, terminal: Terminal) -> int:
    from agents.cli.shared_options import RESUME_NOTE

    try:
        job: Job = options.prepare(options, terminal)
    except (ValueError, OSError) as error:
        return _report(error)
    try:
        return job() or DONE
    except KeyboardInterrupt:
        if options.command in _RESUMABLE:
            terminal.note(RESUME_NOTE)
        raise
    except BrokenPipeError:
        raise
    except OSError as error:  # a disk or a worker process failed
        return _report(error)


def _report(error: ValueError | OSError) -> int:
    text = str(error)
    if isinstance(error, OSError) and error.strerror:  # str(error) begins with a number
        text = ": ".join(str(part) for part in (error.filename, error.strerror) if part)
    from agents.cli.arguments import truncate_message

    _say(truncate_message(text))
    return BAD_INPUT


def _say(text: str) -> None:
    with contextlib.suppress(OSError):  # standard error is closed
        print(f"ferguson: {text}", file=sys.stderr)


def _silence_output() -> None:
    from agents.runtime.terminal import silence

    silence(sys.stdout)  # else the interpreter reports the error when it exits


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    _warn(str(message))


def _warn(text: str) -> None:
    _say(f"warning: {' '.join(text.split())}")


def _parser() -> argparse.ArgumentParser:
    from agents.cli import (
        animate,
        bench,
        compile_ahead,
        completion,
        demos,
        evaluate,
        import_fields,
        plan,
        train,
    )
    from agents.cli.arguments import Parser
    from ferguson_gym import __version__
    from ferguson_gym.world.field_names import GRAMMAR

    parser = Parser(
        prog="ferguson",
        description="Plan paths, evaluate policies and train agents in fields of obstacles.",
        epilog=_EPILOG.format(grammar=GRAMMAR[0].upper() + GRAMMAR[1:]),
    )
    parser.add_argument("--version", action="version", version=f"ferguson {__version__}")
    completion.add_to(parser)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    modules = (plan, evaluate, animate, demos, train, bench)
    named = [(module.__name__.rpartition(".")[2], module) for module in modules]
    for name, module in (*named, ("import", import_fields), ("compile", compile_ahead)):
        texts = {"help": module.HELP, "description": module.DESCRIPTION, "epilog": module.EPILOG}
        module.add_to(commands.add_parser(name, **texts))
    return parser


if __name__ == "__main__":
    sys.exit(main())
