"""`ferguson evaluate`: its arguments and checks."""

from __future__ import annotations

import argparse
import shlex
from textwrap import wrap

from agents.cli import shared_options as shared
from agents.cli.arguments import (
    Parser,
    check_directory,
    check_number,
    positive,
    refuse_twice,
    workers,
)
from agents.cli.completion import POLICY
from agents.models.shipped_agents import shipped
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.world import Field, field_names, initial_state
from planners import PLANNERS

MOST = 10_000_000
"""Upper limit of the flights of one evaluation."""
HELP = "fly policies through the same fields and compare them"
DESCRIPTION = """\
Fly every policy through the same fields in the environment; print tables and write flights.csv,
timings.csv, paths.npz, summary.json, figures and report.html. Failed flights do not change the exit
status, which is 0. After an interruption the same command resumes; if the results are complete, it
only prints them again."""
_INDENT = "\n" + 14 * " "
EPILOG = f"""\
policies:
  planners    {_INDENT.join(wrap(", ".join(PLANNERS), 66))}
  options     NAME+turn=METRES, NAME+backtrack, NAME+margin=METRES,
              NAME+sensing=METRES, also combined; single-start+from=POLICY and
              multi-start+from=POLICY use that policy's segments as initial
              guess
  agents      {", ".join(shipped()) or "no shipped ones"},
              or the directory of a trained one;
              AGENT+tries=N simulates N rollouts and flies the shortest;
              AGENT+sensing=METRES knows obstacles within that range only
  shield      POLICY+shield: guided decides where a segment cannot be
              certified one step ahead (only for policies that decide
              segment by segment)

examples:
  ferguson evaluate --policy multi-start --fields paper:1-4 --seeds 0-9 \\
      --out results/paper
  ferguson evaluate --policy best --policy guided+sensing=20 \\
      --fields standard/validation:0-99 --workers 2 --out results/two
  ferguson evaluate --policy runs/mine --fields town.json --fields villages/ \\
      --out results/mine --json"""


def add_to(evaluate: Parser) -> None:
    """Add the arguments."""
    evaluate.add_argument(
        "--policy",
        action="append",
        required=True,
        metavar="P",
        help="a planner or an agent, see below; may be given several times",
        complete=POLICY,
    )
    shared.add_fields(evaluate, "fields to fly, for example standard/validation:0-9 or files")
    shared.add_out(evaluate)
    shared.add_seeds(evaluate, "policy seeds")
    shared.add_field_changes(evaluate)
    evaluate.add_argument(
        "--workers", type=workers, metavar="N", help="number of worker processes; default: 1"
    )
    evaluate.add_argument(
        "--backend",
        default="processes",
        metavar="NAME",
        help="where to fly: processes on this machine, or dask, a Dask cluster whose workers have "
        "the same versions, and agents at the same paths; the results are the same; to install "
        f"Dask: {installing('cluster')}; default: %(default)s",
    )
    evaluate.add_argument("--address", metavar="HOST:PORT", help="address of the Dask scheduler")
    evaluate.add_argument(
        "--batch",
        type=positive,
        metavar="N",
        help="number of flights that an agent flies at once; the results are the same; default: 48",
    )
    evaluate.add_argument(
        "--fresh", action="store_true", help="start over and replace earlier results in DIR"
    )
    shared.add_json(evaluate)
    shared.add_output_options(evaluate)
    evaluate.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before the flights.

    Raises:
        ValueError: a policy or field is not valid, the directory holds results of another request,
            or arguments do not go together.
        ConnectionError: no scheduler answers.
    """
    from agents.evaluation import run, work
    from agents.evaluation.request import Request, name_of
    from agents.policies import PolicySpec, make_policy
    from agents.runtime import executors

    backend = executors.Backend(
        name=options.backend, workers=options.workers, address=options.address
    )
    refuse_twice("policy", options.policy)
    check_directory(options.out)
    check_number(options.fields, MOST, options.seeds, len(options.policy))
    fields = [field for spec in options.fields for field in sources(spec)]
    refuse_twice("field", [name_of(field) for field in fields])
    changes = shared.field_changes(options)
    request = Request(policies=options.policy, fields=fields, seeds=options.seeds, changes=changes)
    for policy in options.policy:  # last, because loading an agent takes time
        make_policy(policy)
    for source in fields if changes else ():
        request.field(source)  # raises if limits contradict each other, or obstacles hold an end
    files = [request.field(source) for source in fields if isinstance(source, Field)]
    drawn = next(([request.field(name)] for name in fields if isinstance(name, str)), [])
    for policy in options.policy:
        for field in (*files, *drawn):
            PolicySpec.parse(policy).check(field)
    if not options.fresh:
        work.is_finished(work.Work(options.out, request))
    executors.check(backend)

    def job() -> None:
        shared.note_touching(files, terminal)
        run.run(
            *(request, options.out, backend),
            batch=options.batch,
            command=command(options),
            fresh=options.fresh,
            terminal=terminal,
        )

    return job


def sources(spec: str) -> list[str | Field]:
    """The fields of a specification: generated ones by name, those of files as read.

    Generated fields are drawn by the worker processes that fly them.

    Raises:
        ValueError: as `get_fields`, or no flight can begin in a field.
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
    """The command that reproduces the results on this machine."""
    seeds = options.seeds
    numbers = f"{seeds[0]}-{seeds[-1]}" if len(seeds) > 1 else str(seeds[0])
    words = ["ferguson", "evaluate"]
    for name, values in (("--policy", options.policy), ("--fields", options.fields)):
        words += [word for value in values for word in (name, value)]
    words += ["--seeds", numbers]
    words += [*shared.field_changes(options).words(), "--out", str(options.out)]
    return shlex.join(words)
