"""The program `ferguson`: plan a field, evaluate policies.

Exit status 0: done; 1: `plan` found no path; 2: bad input, one line on standard error.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from ferguson_gym import __version__
from ferguson_gym.catalog import GRAMMAR, one, select
from ferguson_gym.fields import Field
from ferguson_gym.flight import depart
from ferguson_gym.suites import LAST_SEED
from planners.catalog import PLANNERS

DONE, NO_PATH, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

_BENCH = "standard/validation:0-99"

Job = Callable[[], int]
"""Work whose input was checked; returns the exit status."""


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
        description="Plan one field; print the plan and how each window came about.",
        epilog="example: ferguson plan paper:2 --planner multi-start --plot flight.png",
    )
    plan.add_argument("field", metavar="FIELD", help="for example paper:1 or my_field.json")
    plan.add_argument("--planner", required=True, metavar="NAME", help=f"one of {names}")
    plan.add_argument("--seed", type=_seed, default=0, metavar="N", help="default: 0")
    plan.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    plan.add_argument("--plot", type=Path, metavar="FILE", help="write a picture (png, pdf, svg)")
    plan.set_defaults(prepare=_prepare_plan)

    evaluate = commands.add_parser(
        "evaluate",
        help="fly policies through the same fields",
        description=(
            "Fly every policy through the same fields in the environment; print the table and "
            "write flights.csv, timings.csv, paths.npz and pictures."
        ),
        epilog=(
            "example: ferguson evaluate --policy multi-start --fields paper:1-4 --seeds 0-9 "
            "--out results/paper"
        ),
    )
    evaluate.add_argument(
        "--policy",
        action="append",
        required=True,
        metavar="P",
        help=f"a planner ({names}); may be given several times",
    )
    evaluate.add_argument(
        "--fields",
        action="append",
        required=True,
        metavar="SPEC",
        help="for example standard/validation:0-9; may be given several times",
    )
    evaluate.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="where results are written"
    )
    evaluate.add_argument(
        "--seeds", type=_seeds, default=range(1), metavar="N|A-B", help="policy seeds; default: 0"
    )
    evaluate.add_argument(
        "--workers", type=_positive, default=1, metavar="N", help="worker processes; default: 1"
    )
    evaluate.set_defaults(prepare=_prepare_evaluate)

    bench = commands.add_parser("bench", help="measure things side by side in one run")
    subjects = bench.add_subparsers(dest="subject", required=True, metavar="SUBJECT")
    planners = subjects.add_parser(
        "planners",
        help="compare solvers",
        description=(
            "Compare solvers on the same windows from the same starts; print the table and write "
            "steps.csv and solvers.png."
        ),
        epilog="example: ferguson bench planners --solvers --windows 200 --out results/solvers",
    )
    planners.add_argument(
        "--solvers",
        action="store_true",
        required=True,
        help="ours, SciPy's SLSQP, and IPOPT through CasADi (pip install 'ferguson-gym[bench]')",
    )
    planners.add_argument(
        "--fields",
        action="append",
        metavar="SPEC",
        help=f"whose windows are taken, in order; may be given several times; default: {_BENCH}",
    )
    planners.add_argument(
        "--windows", type=_positive, default=200, metavar="N", help="default: %(default)s"
    )
    planners.add_argument(
        "--ipopt-every",
        type=_seed,
        default=10,
        metavar="N",
        help="IPOPT solves one window in N, it is slow; 0: none; default: %(default)s",
    )
    planners.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="where results are written"
    )
    planners.set_defaults(prepare=_prepare_bench_planners)
    return parser


def _seed(text: str) -> int:
    if re.fullmatch(r"[0-9]+", text) is None:
        raise argparse.ArgumentTypeError(f"a seed is a whole number from 0 on, got {text!r}")
    return _within(int(text))


def _within(seed: int) -> int:
    if seed > LAST_SEED:
        raise argparse.ArgumentTypeError(f"a seed is at most 2**63 - 1, got {seed}")
    return seed


def _seeds(text: str) -> range:
    match = re.fullmatch(r"([0-9]+)(?:-([0-9]+))?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"seeds are a number or A-B, got {text!r}")
    first = int(match[1])
    last = first if match[2] is None else int(match[2])
    if first > last:
        raise argparse.ArgumentTypeError(f"empty range of seeds {text!r}: {first} is above {last}")
    return range(first, _within(last) + 1)


def _positive(text: str) -> int:
    if re.fullmatch(r"[0-9]+", text) is None or int(text) < 1:
        raise argparse.ArgumentTypeError(f"need a whole number from 1 on, got {text!r}")
    return int(text)


def _prepare_plan(options: argparse.Namespace) -> Job:
    from agents import planning
    from agents.pictures import check_target
    from planners.catalog import make

    planner = make(options.planner)
    field = one(options.field)
    depart(field)  # refuses what cannot be flown
    if options.plot is not None:
        check_target(options.plot)

    def job() -> int:
        report = planning.plan(planner, options.planner, field, options.seed)
        if options.json:
            print(report.to_json())
        else:
            report.show()
        if options.plot is not None:
            report.draw(options.plot)
        return DONE if report.plan.success else NO_PATH

    return job


def _prepare_evaluate(options: argparse.Namespace) -> Job:
    from agents import evaluation
    from agents.policies import make_policy

    for policy in options.policy:
        make_policy(policy)
    fields: list[Field] = [field for spec in options.fields for field in select(spec)]
    for field in fields:
        depart(field)
    _refuse_twice("policy", options.policy)
    _refuse_twice("field", [field.name for field in fields])
    _check_directory(options.out)

    def job() -> int:
        evaluation.evaluate(options.policy, fields, options.seeds, options.out, options.workers)
        return DONE

    return job


def _prepare_bench_planners(options: argparse.Namespace) -> Job:
    import importlib.util

    from agents import solver_bench
    from planners.catalog import multi_start

    _check_directory(options.out)
    if options.ipopt_every and importlib.util.find_spec("casadi") is None:
        raise ValueError(
            "IPOPT comes with CasADi: pip install 'ferguson-gym[bench]', or leave it out with "
            "--ipopt-every 0"
        )
    fields = (field for spec in options.fields or [_BENCH] for field in select(spec))
    tasks = solver_bench.take_windows(multi_start(), fields, options.windows)

    def job() -> int:
        solver_bench.bench(tasks, options.ipopt_every, options.out)
        return DONE

    return job


def _check_directory(out: Path) -> None:
    for place in (out, *out.parents):
        if place.exists() and not place.is_dir():
            raise ValueError(f"--out {out}: {place} is a file, not a directory")


def _refuse_twice(what: str, names: Sequence[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ValueError(f"{what} {name} is named twice")
        seen.add(name)


if __name__ == "__main__":
    sys.exit(main())
