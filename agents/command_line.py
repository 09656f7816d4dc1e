"""The program `ferguson`: plan a field, train and evaluate policies, show a flight.

Exit status 0: done; 1: `plan` found no path; 2: bad input, one line on standard error.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from agents import bench_commands, demos_command, evaluate_command, train_command
from agents.arguments import DONE, Job, seed
from ferguson_gym import __version__
from ferguson_gym.catalog import GRAMMAR, one
from ferguson_gym.flight import depart
from planners.catalog import PLANNERS, named

NO_PATH, BAD_INPUT, INTERRUPTED = 1, 2, 130


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit status."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        options = _parser().parse_args(arguments)
    except SystemExit as stop:  # --help, --version, or a command line that was refused
        return int(stop.code or 0)
    try:
        job: Job = options.prepare(options)
    except (ValueError, OSError) as error:
        print(f"ferguson: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("ferguson: interrupted", file=sys.stderr)
        return INTERRUPTED
    try:
        status = job()
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:  # the disk refused what was asked for
        print(f"ferguson: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("ferguson: interrupted", file=sys.stderr)
        return INTERRUPTED


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"ferguson: warning: {message}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    names = ", ".join(PLANNERS)
    parser = _Parser(
        prog="ferguson",
        description="Plan and evaluate flights through fields of obstacles.",
        epilog=GRAMMAR[0].upper() + GRAMMAR[1:] + ".",
    )
    parser.add_argument("--version", action="version", version=f"ferguson {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    plan = commands.add_parser(
        "plan",
        help="plan one field",
        description="Plan one field; print the plan, and the windows or the route it came from.",
        epilog="example: ferguson plan paper:2 --planner multi-start --plot flight.png",
    )
    plan.add_argument("field", metavar="FIELD", help="for example paper:1 or my_field.json")
    plan.add_argument("--planner", required=True, metavar="NAME", help=f"one of {names}")
    plan.add_argument("--seed", type=seed, default=0, metavar="N", help="default: 0")
    plan.add_argument(
        "--sensing-range",
        type=float,
        metavar="R",
        help="know only the obstacles within R metres of where the vehicle has been; at least 15, "
        "for single-start, multi-start, guided and pursuit",
    )
    plan.add_argument(
        "--backtrack", action="store_true", help="out of a dead end, be led along the shortest way"
    )
    plan.add_argument(
        "--turn-radius", type=float, metavar="R", help="turn no sharper than R metres (guided)"
    )
    plan.add_argument(
        "--start-from",
        metavar="AGENT",
        help="start from what an agent, or any other policy, would fly (single-start, multi-start)",
    )
    plan.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    plan.add_argument("--plot", type=Path, metavar="FILE", help="write a picture (png, pdf, svg)")
    plan.set_defaults(prepare=_prepare_plan)

    evaluate = commands.add_parser(
        "evaluate",
        help="fly policies through the same fields",
        description=(
            "Fly every policy through the same fields in the environment; print the table and "
            "write flights.csv, timings.csv, paths.npz, summary.json and pictures. Flights do not "
            "depend on who flies them. Interrupted, the same command goes on; where the results "
            "are there already, it flies nothing."
        ),
        epilog=(
            "example: ferguson evaluate --policy multi-start --fields paper:1-4 --seeds 0-9 "
            "--out results/paper"
        ),
    )
    evaluate_command.add_to(evaluate)

    animate = commands.add_parser(
        "animate",
        help="show a flight as it is decided, a GIF",
        description=(
            "Fly a policy through one field and write a GIF: in each window the first guesses, "
            "the plan that came of them, what it sees and the way left behind it, then the "
            "segment that is flown."
        ),
        epilog="example: ferguson animate paper:3 --policy guided --out flight.gif",
    )
    animate.add_argument("field", metavar="FIELD", help="for example paper:1 or my_field.json")
    animate.add_argument("--policy", required=True, metavar="NAME", help=f"one of {names}")
    animate.add_argument("--out", type=Path, required=True, metavar="FILE", help="a .gif")
    animate.add_argument("--seed", type=seed, default=0, metavar="N", help="default: 0")
    animate.set_defaults(prepare=_prepare_animate)

    demos = commands.add_parser(
        "demos",
        help="record an expert's flights",
        description=(
            "Fly a planner through fields in the environment and write its flights as a Minari "
            "dataset (pip install 'ferguson-gym[demos]'). Failed flights are left out and counted."
        ),
        epilog="example: ferguson demos --expert guided --fields standard/train:0-999 "
        "--out ferguson/guided-v0 --workers 2",
    )
    demos_command.add_to(demos)

    train = commands.add_parser(
        "train",
        help="train an agent",
        description=(
            "Train an agent; evaluate it while it learns, keep the best model and checkpoints, and "
            "write model.zip, model.json, curve.csv and TensorBoard's logs. Interrupted, the same "
            "command goes on."
        ),
        epilog="example: ferguson train ppo --minutes 30 --out runs/ppo",
    )
    train_command.add_to(train)

    bench = commands.add_parser("bench", help="measure things side by side in one run")
    bench_commands.add_to(bench)
    return parser


def _prepare_plan(options: argparse.Namespace) -> Job:
    from agents import planning
    from agents.pictures import check_target
    from agents.policies import make_planner
    from agents.warm_up import warm

    name = named(
        options.planner,
        options.backtrack,
        options.sensing_range,
        options.turn_radius,
        options.start_from,
    )
    make_planner(name)  # refuses unknown names, and options that do not fit
    field = one(options.field)
    depart(field)  # refuses what cannot be flown
    if options.plot is not None:
        check_target(options.plot)

    def job() -> int:
        report = planning.plan(warm(name), name, field, options.seed)
        if options.json:
            print(report.to_json())
        else:
            report.show()
        if options.plot is not None:
            report.draw(options.plot)
        return DONE if report.plan.success else NO_PATH

    return job


def _prepare_animate(options: argparse.Namespace) -> Job:
    from agents.animation import animate
    from agents.flights import fly_by_name
    from agents.gif import SUFFIX
    from agents.pictures import check_target
    from agents.policies import is_planner, make_policy
    from agents.progress import still_bar

    make_policy(options.policy)  # refuses unknown names
    if not is_planner(options.policy):
        raise ValueError(
            f"an animation shows how a planner decides, and {options.policy!r} is an agent, which "
            f"plans nothing; planners are {', '.join(PLANNERS)}"
        )
    field = one(options.field)
    depart(field)
    check_target(options.out, "animation", [SUFFIX])

    def job() -> int:
        flight = fly_by_name(options.policy, field, options.seed)
        with still_bar() as progress:
            frames = animate(flight, options.out, progress)
        print(
            f"{flight.policy} on {field.name}, seed {flight.seed}: {flight.outcome.sentence}, "
            f"{len(flight.control)} segments, {flight.length:.4f} m"
        )
        print(f"wrote {frames} frames to {options.out}")
        return DONE

    return job


if __name__ == "__main__":
    sys.exit(main())
