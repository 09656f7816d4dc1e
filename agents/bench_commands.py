"""The subcommands of `ferguson bench`: what they are asked, and the input checked."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.arguments import DONE, Job, check_directory, duration, positive, seed
from ferguson_gym.catalog import select
from ferguson_gym.observations import KINDS

_FIELDS = "standard/validation:0-99"


def add_to(bench: argparse.ArgumentParser) -> None:
    """Give the command its subcommands."""
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
        help=f"whose windows are taken, in order; may be given several times; default: {_FIELDS}",
    )
    planners.add_argument(
        "--windows", type=positive, default=200, metavar="N", help="default: %(default)s"
    )
    planners.add_argument(
        "--ipopt-every",
        type=seed,
        default=10,
        metavar="N",
        help="IPOPT solves one window in N, it is slow; 0: none; default: %(default)s",
    )
    planners.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="where results are written"
    )
    planners.set_defaults(prepare=_prepare_planners)

    env = subjects.add_parser(
        "env",
        help="steps per second of the environment",
        description=(
            "Measure steps per second of the environment, scalar and vector, beside Gymnasium's "
            "CartPole-v1, and what a fresh process takes; print the tables."
        ),
        epilog="example: ferguson bench env --seconds 1 --out results/speed",
    )
    env.add_argument(
        "--observation",
        choices=KINDS,
        default=KINDS[0],
        help="default: %(default)s",
    )
    env.add_argument(
        "--seconds",
        type=duration,
        default=0.4,
        metavar="S",
        help="of each environment in each round; default: %(default)s",
    )
    env.add_argument("--rounds", type=positive, default=5, metavar="N", help="default: %(default)s")
    env.add_argument(
        "--seed", type=seed, default=0, metavar="N", help="of actions and fields; default: 0"
    )
    env.add_argument(
        "--first-step",
        action="store_true",
        help="also time a first step that has to compile: half a minute more",
    )
    env.add_argument(
        "--out", type=Path, metavar="DIR", help="where steps.csv and summary.json are written"
    )
    env.set_defaults(prepare=_prepare_env)


def _prepare_planners(options: argparse.Namespace) -> Job:
    import importlib.util

    from agents import solver_bench
    from planners.catalog import multi_start

    check_directory(options.out)
    if options.ipopt_every and importlib.util.find_spec("casadi") is None:
        raise ValueError(
            "IPOPT comes with CasADi: pip install 'ferguson-gym[bench]', or leave it out with "
            "--ipopt-every 0"
        )
    fields = (field for spec in options.fields or [_FIELDS] for field in select(spec))
    tasks = solver_bench.take_windows(multi_start(), fields, options.windows)

    def job() -> int:
        solver_bench.bench(tasks, options.ipopt_every, options.out)
        return DONE

    return job


def _prepare_env(options: argparse.Namespace) -> Job:
    from agents import env_bench, env_drivers

    if options.out is not None:
        check_directory(options.out)
    request = env_bench.Request(
        observation=options.observation,
        seconds=options.seconds,
        rounds=options.rounds,
        seed=options.seed,
        first_step=options.first_step,
    )
    entries = env_drivers.entries(options.observation)

    def job() -> int:
        env_bench.bench(entries, request, options.out)
        return DONE

    return job
