"""`ferguson evaluate`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

from agents.arguments import DONE, Job, check_directory, positive, refuse_twice, seeds
from ferguson_gym import catalog
from ferguson_gym.fields import Field
from ferguson_gym.flight import depart
from planners.catalog import OPTIONS, PLANNERS


def add_to(evaluate: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    evaluate.add_argument(
        "--policy",
        action="append",
        required=True,
        metavar="P",
        help=f"a planner ({', '.join(PLANNERS)}), with options {OPTIONS}; an agent that is shipped "
        "(best is the best of them), or the directory of one that was trained; single-start and "
        "multi-start with +from=POLICY, which starts from that policy's proposals; any policy that "
        "decides step by step with +shield, where guided takes over doubtful steps; may be given "
        "several times",
    )
    evaluate.add_argument(
        "--fields",
        action="append",
        required=True,
        metavar="SPEC",
        help="for example standard/validation:0-9; may be given several times",
    )
    evaluate.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="where results are written; interrupted, the same command goes on with what is there",
    )
    evaluate.add_argument(
        "--seeds", type=seeds, default=range(1), metavar="N|A-B", help="policy seeds; default: 0"
    )
    evaluate.add_argument(
        "--workers", type=positive, metavar="N", help="worker processes on this machine; default: 1"
    )
    evaluate.add_argument(
        "--backend",
        default="processes",
        metavar="NAME",
        help="who flies: processes on this machine, or dask or ray, the workers of a cluster (pip "
        "install 'ferguson-gym[cluster]'), which need the same versions, and agents at the same "
        "paths; no flight depends on it; default: %(default)s",
    )
    evaluate.add_argument(
        "--address", metavar="HOST:PORT", help="of the cluster's scheduler; Ray: default its own"
    )
    evaluate.add_argument(
        "--batch",
        type=positive,
        metavar="N",
        help="flights of an agent in the air at a time; no flight depends on it; default: 48",
    )
    evaluate.add_argument(
        "--fresh", action="store_true", help="start over, whatever results or work lie in DIR"
    )
    evaluate.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is flown.

    Raises:
        ValueError: policies or fields that cannot be, something else in the directory of results,
            or arguments that do not go together.
        ConnectionError: no scheduler answers.
    """
    from agents import backends, evaluation, evaluation_work
    from agents.evaluation_request import Request, name_of
    from agents.policies import make_policy

    backend = backends.Backend(
        name=options.backend, workers=options.workers, address=options.address
    )
    for policy in options.policy:
        make_policy(policy)
    fields = [field for spec in options.fields for field in sources(spec)]
    refuse_twice("policy", options.policy)
    refuse_twice("field", [name_of(field) for field in fields])
    check_directory(options.out)
    request = Request(policies=options.policy, fields=fields, seeds=options.seeds)
    if not options.fresh:
        evaluation_work.check(evaluation_work.Work(options.out, request))
    backends.check(backend)

    def job() -> int:
        try:
            evaluation.run(
                request,
                options.out,
                backend,
                together=options.batch,
                command=command(options),
                fresh=options.fresh,
            )
        except KeyboardInterrupt:
            sys.stderr.write("ferguson: the same command goes on where this one stopped\n")
            raise
        return DONE

    return job


def sources(spec: str) -> list[str | Field]:
    """What a specification names: drawn fields by name, to be drawn by who flies; others as read.

    Raises:
        ValueError: as `catalog.select`, or a field in which no flight can begin.
    """
    fields = catalog.select(spec)
    try:
        name, numbers = catalog.family(spec)
    except ValueError:  # files
        read: list[str | Field] = []
        for field in fields:
            depart(field)
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
