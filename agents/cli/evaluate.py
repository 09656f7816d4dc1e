"""`ferguson evaluate`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
import shlex

from agents.cli.arguments import (
    GOES_ON,
    add_output_options,
    check_directory,
    check_number,
    directory,
    positive,
    refuse_twice,
    seeds,
    workers,
)
from agents.cli.completion import DIRECTORY, FIELDS, POLICY, completes
from agents.models.shipped_agents import shipped
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.world import field_names
from ferguson_gym.world.field import Field
from ferguson_gym.world.transition import initial_state
from planners.registry import PLANNERS

MOST = 10_000_000
"""Flights of one evaluation."""
HELP = "fly policies through the same fields"
DESCRIPTION = """\
Fly every policy through the same fields in the environment; print the tables and write flights.csv,
timings.csv, paths.npz, summary.json, pictures and report.html. Exit status 0 also when flights
fail. Interrupted, the same command goes on; where the results are there already, it flies nothing
and shows them."""
EPILOG = f"""\
policies:
  planners    {", ".join(list(PLANNERS)[:6])},
              {", ".join(list(PLANNERS)[6:])}
  options     NAME+turn=METRES, NAME+backtrack, NAME+margin=METRES,
              NAME+sensing=METRES, or several; single-start and multi-start
              with +from=POLICY start from what that policy would fly
  agents      {", ".join(shipped()) or "none are shipped"}, or the directory of a trained one;
              AGENT+tries=N imagines N flights and flies the shortest
  +shield     ends the name of any policy that decides step by step:
              guided takes over doubtful steps

examples:
  ferguson evaluate --policy multi-start --fields paper:1-4 --seeds 0-9 \\
      --out results/paper
  ferguson evaluate --policy best --policy guided+sensing=20 \\
      --fields standard/validation:0-99 --workers 2 --out results/two
  ferguson evaluate --policy runs/mine --fields town.json --fields villages/ \\
      --out results/mine --json"""


def add_to(evaluate: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    completes(
        evaluate.add_argument(
            "--policy",
            action="append",
            required=True,
            metavar="P",
            help="a planner, or an agent: see below; may be given several times",
        ),
        POLICY,
    )
    completes(
        evaluate.add_argument(
            "--fields",
            action="append",
            required=True,
            metavar="SPEC",
            help="for example standard/validation:0-9, or files; may be given several times",
        ),
        FIELDS,
    )
    completes(
        evaluate.add_argument(
            "--out", type=directory, required=True, metavar="DIR", help="where results are written"
        ),
        DIRECTORY,
    )
    evaluate.add_argument(
        "--seeds", type=seeds, default=range(1), metavar="N|A-B", help="policy seeds; default: 0"
    )
    evaluate.add_argument(
        "--workers", type=workers, metavar="N", help="worker processes on this machine; default: 1"
    )
    evaluate.add_argument(
        "--backend",
        default="processes",
        metavar="NAME",
        help="who flies: processes on this machine, or dask, the workers of a Dask cluster "
        f"({installing('cluster')}), which need the same versions, and agents at the same paths; "
        "no flight depends on it; default: %(default)s",
    )
    evaluate.add_argument("--address", metavar="HOST:PORT", help="of the cluster's scheduler")
    evaluate.add_argument(
        "--batch",
        type=positive,
        metavar="N",
        help="flights of an agent in the air at a time; no flight depends on it; default: 48",
    )
    evaluate.add_argument(
        "--fresh", action="store_true", help="start over, whatever results or work lie in DIR"
    )
    evaluate.add_argument(
        "--json", action="store_true", help="print summary.json's object, nothing else"
    )
    add_output_options(evaluate)
    evaluate.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is flown.

    Raises:
        ValueError: policies or fields that cannot be, something else in the directory of results,
            or arguments that do not go together.
        ConnectionError: no scheduler answers.
    """
    from agents.evaluation import run, work
    from agents.evaluation.request import Request, name_of
    from agents.policies.registry import make_policy
    from agents.runtime import executors

    backend = executors.Backend(
        name=options.backend, workers=options.workers, address=options.address
    )
    refuse_twice("policy", options.policy)
    check_directory(options.out)
    check_number(options.fields, MOST, options.seeds, len(options.policy))
    fields = [field for spec in options.fields for field in sources(spec)]
    refuse_twice("field", [name_of(field) for field in fields])
    for policy in options.policy:  # last: an agent is loaded
        make_policy(policy)
    request = Request(policies=options.policy, fields=fields, seeds=options.seeds)
    if not options.fresh:
        work.check(work.Work(options.out, request))
    executors.check(backend)
    terminal = Terminal(quiet=options.quiet, colour=options.colour, as_json=options.json)

    def job() -> int:
        try:
            run.run(
                request,
                options.out,
                backend,
                together=options.batch,
                command=command(options),
                fresh=options.fresh,
                terminal=terminal,
            )
        except KeyboardInterrupt:
            terminal.note(GOES_ON)
            raise
        return DONE

    return job


def sources(spec: str) -> list[str | Field]:
    """What a specification names: drawn fields by name, to be drawn by who flies; others as read.

    Raises:
        ValueError: as `get_fields`, or a field in which no flight can begin.
    """
    fields = field_names.get_fields(spec)
    try:
        name, numbers = field_names.family(spec)
    except ValueError:  # files
        read: list[str | Field] = []
        for field in fields:
            initial_state(field)
            read.append(field)
        return read
    return [f"{name}:{number}" for number in numbers]


def command(options: argparse.Namespace) -> str:
    """The command that makes the same results again, on this machine."""
    seeds = options.seeds
    numbers = f"{seeds[0]}-{seeds[-1]}" if len(seeds) > 1 else str(seeds[0])
    words = ["ferguson", "evaluate"]
    for name, values in (("--policy", options.policy), ("--fields", options.fields)):
        words += [word for value in values for word in (name, value)]
    words += ["--seeds", numbers, "--out", str(options.out)]
    return shlex.join(words)
