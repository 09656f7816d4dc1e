"""The subcommands of `ferguson bench`: what they are asked, and the input checked."""

from __future__ import annotations

import argparse

from agents.cli.arguments import (
    add_output_options,
    check_directory,
    check_number,
    directory,
    duration,
    positive,
    refuse_twice,
    seed,
    seeds,
    workers,
)
from agents.cli.completion import DIRECTORY, FIELDS, PLANNER, completes
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.simulation.observations import KINDS
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.transition import initial_state
from planners.registry import PLANNERS, make

_FIELDS = "standard/validation:0-99"
_MOST = 1_000_000
"""Plans of one comparison."""
HELP = "measure things side by side in one run"
DESCRIPTION = "Measure things side by side in one run; their ratios hold where their times do not."
EPILOG = """\
examples:
  ferguson bench planners --fields standard/validation:0-9 --out results/peers
  ferguson bench solvers --windows 50 --ipopt-every 0 --out results/solvers
  ferguson bench env --observation rays"""


def add_to(bench: argparse.ArgumentParser) -> None:
    """Give the command its subcommands."""
    subjects = bench.add_subparsers(dest="subject", required=True, metavar="SUBJECT")
    _add_planners(
        subjects.add_parser(
            "planners",
            help="compare planners",
            description=(
                "Plan the same fields with every planner, from the start and certified; print the "
                "table and write planners.csv, planners.log (for OMPL's Planner Arena), "
                "summary.json and pictures."
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
            help="compare solvers of windows",
            description=(
                "Compare solvers on the same windows from the same starts: ours, SciPy's SLSQP, "
                "and IPOPT through CasADi. Print the table and write steps.csv and solvers.png. "
                f"CasADi: {installing('bench')}"
            ),
            epilog="examples:\n"
            "  ferguson bench solvers --windows 200 --out results/solvers\n"
            "  ferguson bench solvers --windows 20 --ipopt-every 0 --out results/solvers",
        )
    )
    _add_env(
        subjects.add_parser(
            "env",
            help="steps per second of the environment",
            description=(
                "Measure steps per second of the environment, scalar and vector, beside "
                "Gymnasium's CartPole-v1, and what a fresh process takes; print the tables."
            ),
            epilog="examples:\n"
            "  ferguson bench env\n"
            "  ferguson bench env --observation rays --seconds 1 --out results/speed",
        )
    )


def _add_planners(planners: argparse.ArgumentParser) -> None:
    completes(
        planners.add_argument(
            "--fields",
            action="append",
            required=True,
            metavar="SPEC",
            help="for example standard/validation:0-9; may be given several times",
        ),
        FIELDS,
    )
    completes(
        planners.add_argument(
            "--planner",
            action="append",
            metavar="NAME",
            help=f"one of {', '.join(PLANNERS)}; may be given several times; default: all that "
            "are installed",
        ),
        PLANNER,
    )
    planners.add_argument(
        "--seeds", type=seeds, default=range(1), metavar="N|A-B", help="of planners; default: 0"
    )
    planners.add_argument(
        "--seconds",
        type=duration,
        metavar="S",
        help="what planners search that could go on; default: their own budgets",
    )
    planners.add_argument(
        "--workers",
        type=workers,
        default=1,
        metavar="N",
        help="worker processes; times compare only with one, the default",
    )
    _add_out(planners, required=True)
    _add_json(planners)
    add_output_options(planners)
    planners.set_defaults(prepare=_prepare_planners)


def _add_solvers(solvers: argparse.ArgumentParser) -> None:
    completes(
        solvers.add_argument(
            "--fields",
            action="append",
            metavar="SPEC",
            help="whose windows are taken, in order; may be given several times; "
            f"default: {_FIELDS}",
        ),
        FIELDS,
    )
    solvers.add_argument(
        "--windows",
        type=positive,
        default=200,
        metavar="N",
        help="how many; default: %(default)s",
    )
    solvers.add_argument(
        "--ipopt-every",
        type=seed,
        default=10,
        metavar="N",
        help="IPOPT solves one window in N, it is slow; 0: none; default: %(default)s",
    )
    _add_out(solvers, required=True)
    add_output_options(solvers)
    solvers.set_defaults(prepare=_prepare_solvers)


def _add_env(env: argparse.ArgumentParser) -> None:
    env.add_argument(
        "--observation",
        choices=KINDS,
        default=KINDS[0],
        metavar="KIND",
        help=f"{', '.join(KINDS)}; default: %(default)s",
    )
    env.add_argument(
        "--seconds",
        type=duration,
        default=0.4,
        metavar="S",
        help="of each environment in each round; default: %(default)s",
    )
    env.add_argument(
        "--rounds", type=positive, default=5, metavar="N", help="how many; default: %(default)s"
    )
    env.add_argument(
        "--seed", type=seed, default=0, metavar="N", help="of actions and fields; default: 0"
    )
    env.add_argument(
        "--first-step",
        action="store_true",
        help="also time a first step that has to compile: half a minute more",
    )
    _add_out(env, required=False)
    _add_json(env)
    add_output_options(env)
    env.set_defaults(prepare=_prepare_env)


def _add_out(command: argparse.ArgumentParser, required: bool) -> None:
    argument = command.add_argument(
        "--out", type=directory, required=required, metavar="DIR", help="where results are written"
    )
    completes(argument, DIRECTORY)


def _add_json(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--json", action="store_true", help="print summary.json's object, nothing else"
    )


def _prepare_planners(options: argparse.Namespace) -> Job:
    from agents.benchmarks.planners import bench as planner_bench

    check_directory(options.out)
    planners = len(options.planner or PLANNERS)
    check_number(options.fields, _MOST, options.seeds, planners)
    fields = [field for spec in options.fields for field in get_fields(spec)]
    for field in fields:
        initial_state(field)
    refuse_twice("field", [field.name for field in fields])
    refuse_twice("planner", options.planner or [])
    missing = {name: hint for name in options.planner or PLANNERS if (hint := _missing(name))}
    if options.planner and missing:
        raise ValueError("; ".join(missing.values()))
    request = planner_bench.Request(
        planners=[name for name in options.planner or PLANNERS if name not in missing],
        left_out=missing,
        fields=fields,
        seeds=options.seeds,
        seconds=options.seconds,
        workers=options.workers,
    )

    terminal = Terminal(quiet=options.quiet, colour=options.colour, as_json=options.json)

    def job() -> int:
        planner_bench.bench(request, options.out, terminal)
        return DONE

    return job


def _missing(planner: str) -> str:
    """Why a planner cannot be made here, and what would help; empty if it can."""
    try:
        make(planner)
    except ValueError as error:
        return str(error)
    return ""


def _prepare_solvers(options: argparse.Namespace) -> Job:
    import importlib.util

    from agents.benchmarks import solvers as solver_bench
    from planners.registry import multi_start

    check_directory(options.out)
    if options.ipopt_every and importlib.util.find_spec("casadi") is None:
        raise ValueError(
            f"IPOPT comes with CasADi: {installing('bench')}, or leave it out with --ipopt-every 0"
        )
    fields = (field for spec in options.fields or [_FIELDS] for field in get_fields(spec))
    tasks = solver_bench.take_windows(multi_start(), fields, options.windows)

    terminal = Terminal(quiet=options.quiet, colour=options.colour)

    def job() -> int:
        solver_bench.bench(tasks, options.ipopt_every, options.out, terminal)
        return DONE

    return job


def _prepare_env(options: argparse.Namespace) -> Job:
    from agents.benchmarks.environment import bench as env_bench
    from agents.benchmarks.environment import drivers

    if options.out is not None:
        check_directory(options.out)
    request = env_bench.Request(
        observation=options.observation,
        seconds=options.seconds,
        rounds=options.rounds,
        seed=options.seed,
        first_step=options.first_step,
    )
    entries = drivers.entries(options.observation)

    terminal = Terminal(quiet=options.quiet, colour=options.colour, as_json=options.json)

    def job() -> int:
        env_bench.bench(entries, request, options.out, terminal)
        return DONE

    return job
