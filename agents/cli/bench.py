"""`ferguson bench planners`, `solvers` and `env`: their arguments and checks."""

from __future__ import annotations

import argparse
from functools import partial

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser, check_directory, check_number, duration, refuse_twice, seed
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.world import get_fields, initial_state
from planners import PLANNERS, make
from planners.registry import PlannerSpec

_FIELDS = "standard/validation:0-99"
_MOST = 1_000_000
"""Upper limit of the plans of one comparison."""
HELP = "benchmark planners, solvers or the environment"
DESCRIPTION = (
    "Compare planners, solvers or environments in one run. Times depend on the machine and its "
    "load; compare only ratios within one run."
)
EPILOG = """\
examples:
  ferguson bench planners --fields standard/validation:0-9 --out results/peers
  ferguson bench solvers --windows 50 --ipopt-every 0 --out results/solvers
  ferguson bench env --observation discs"""


def add_to(bench: Parser) -> None:
    """Add the subcommands."""
    subjects = bench.add_subparsers(dest="subject", required=True, metavar="SUBJECT")
    _add_planners(
        subjects.add_parser(
            "planners",
            help="compare planners on the same fields",
            description=(
                "Plan the same fields with every planner and certify the paths; print a table and "
                "write planners.csv, planners.log (for OMPL's Planner Arena), summary.json and "
                "figures."
            ),
            epilog="examples:\n"
            "  ferguson bench planners --fields standard/validation:0-99 \\\n"
            "      --out results/planners\n"
            "  ferguson bench planners --planner shortest --planner rrt-star \\\n"
            "      --fields sparse/validation:0-9 --seconds 0.5 --out results/two",
        )
    )
    _add_solvers(
        subjects.add_parser(
            "solvers",
            help="compare solvers on the same planning windows",
            description=(
                "Compare three solvers on the same planning windows from the same initial guesses: "
                "ours, SciPy's SLSQP, and IPOPT through CasADi. Print a table and write steps.csv "
                f"and solvers.png. To install CasADi: {installing('bench')}"
            ),
            epilog="examples:\n"
            "  ferguson bench solvers --windows 200 --out results/solvers\n"
            "  ferguson bench solvers --windows 20 --ipopt-every 0 --out results/solvers",
        )
    )
    _add_env(
        subjects.add_parser(
            "env",
            help="measure steps per second of the environment",
            description=(
                "Measure steps per second of the scalar and the vector environment beside "
                "Gymnasium's CartPole-v1, and the start-up time and memory of a fresh process; "
                "print tables."
            ),
            epilog="examples:\n"
            "  ferguson bench env\n"
            "  ferguson bench env --observation discs --seconds 1 --out results/speed",
        )
    )


def _add_planners(planners: Parser) -> None:
    shared.add_fields(planners, "fields to plan, for example standard/validation:0-9")
    several = f"{', '.join(PLANNERS)}; may be given several times; default: all that are installed"
    shared.add_planner(planners, "--planner", action="append", help=f"a planner: {several}")
    shared.add_seeds(planners, "planner seeds")
    shared.add_field_changes(planners)
    planners.add_argument(
        "--seconds",
        type=duration,
        metavar="S",
        help="search time of planners with a budget; default: each planner's own budget",
    )
    shared.add_workers(
        planners, "number of worker processes; times are comparable only with one process"
    )
    shared.add_out(planners)
    shared.add_json(planners)
    shared.add_output_options(planners)
    planners.set_defaults(prepare=_prepare_planners)


def _add_solvers(solvers: Parser) -> None:
    fields = f"fields whose windows are solved, in order; default: {_FIELDS}"
    shared.add_fields(solvers, fields, required=False)
    shared.add_field_changes(solvers)
    shared.add_count(solvers, "--windows", 200, "number of windows")
    solvers.add_argument(
        "--ipopt-every",
        type=seed,
        default=10,
        metavar="N",
        help="let IPOPT, which is slow, solve every Nth window; 0 turns IPOPT off; "
        "default: %(default)s",
    )
    shared.add_out(solvers)
    shared.add_output_options(solvers)
    solvers.set_defaults(prepare=_prepare_solvers)


def _add_env(env: Parser) -> None:
    shared.add_observation(env)
    env.add_argument(
        "--seconds",
        type=duration,
        default=0.4,
        metavar="S",
        help="time per environment and round; default: %(default)s",
    )
    shared.add_count(env, "--rounds", 5, "number of rounds")
    shared.add_seed(env, "seed of the actions and fields")
    env.add_argument(
        "--first-step",
        action="store_true",
        help="also time a first step with compilation, which takes half a minute or more",
    )
    shared.add_out(env, required=False)
    shared.add_json(env)
    shared.add_output_options(env)
    env.set_defaults(prepare=_prepare_env)


def _prepare_planners(options: argparse.Namespace, terminal: Terminal) -> Job:
    from agents.benchmarks.planners import bench

    check_directory(options.out)
    names = options.planner or list(PLANNERS)
    check_number(options.fields, _MOST, options.seeds, len(names))
    named = (field for spec in options.fields for field in get_fields(spec))
    changes = shared.field_changes(options)
    fields = [changes.apply(field) for field in named]
    for field in fields:
        initial_state(field)
    refuse_twice("field", [field.name for field in fields])
    refuse_twice("planner", names)
    missing = {name: reason for name in names if (reason := _missing(name))}
    for name in names:
        for field in fields:
            PlannerSpec.parse(name).check(field)
    if options.planner and missing:
        raise ValueError("; ".join(missing.values()))
    request = bench.Request(
        planners=[name for name in names if name not in missing],
        left_out=missing,
        fields=fields,
        seeds=options.seeds,
        seconds=options.seconds,
        workers=options.workers,
        changes=changes,
    )

    def job() -> None:
        shared.note_touching(fields, terminal)
        bench.bench(request, options.out, terminal)

    return job


def _missing(planner: str) -> str:
    """Why a planner cannot be made, with the remedy; empty if it can."""
    try:
        make(planner)
    except ValueError as error:
        return str(error)
    return ""


def _prepare_solvers(options: argparse.Namespace, terminal: Terminal) -> Job:
    import importlib.util

    from agents.benchmarks import solvers
    from planners.constructors import multi_start

    check_directory(options.out)
    if options.ipopt_every and importlib.util.find_spec("casadi") is None:
        raise ValueError(
            f"IPOPT comes with CasADi: {installing('bench')}, or leave it out with --ipopt-every 0"
        )
    named = (field for spec in options.fields or [_FIELDS] for field in get_fields(spec))
    fields = map(shared.field_changes(options).apply, named)
    tasks = solvers.take_windows(multi_start(), fields, options.windows)
    return partial(solvers.bench, tasks, options.ipopt_every, options.out, terminal)


def _prepare_env(options: argparse.Namespace, terminal: Terminal) -> Job:
    from agents.benchmarks.environment import bench, drivers

    if options.out is not None:
        check_directory(options.out)
    request = bench.Request(
        observation=options.observation,
        seconds=options.seconds,
        rounds=options.rounds,
        seed=options.seed,
        first_step=options.first_step,
    )
    entries = drivers.entries(options.observation)
    return partial(bench.bench, entries, request, options.out, terminal)
