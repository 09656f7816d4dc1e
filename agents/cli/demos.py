"""`ferguson demos`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
import json
import sys

from agents.cli.arguments import GOES_ON, add_output_options, check_number, positive, workers
from agents.cli.completion import FIELDS, PLANNER, completes
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.simulation.observations import KINDS
from planners.registry import OPTIONS, PLANNERS

NO_DEMONSTRATIONS = 1
HELP = "record an expert's flights"
DESCRIPTION = f"""\
Fly a planner through fields in the environment and write its flights as a Minari dataset. Failed
flights are left out and counted. Interrupted, the same command goes on. Exit status 1: no flight
succeeded. Minari: {installing("demos")}"""
EPILOG = """\
examples:
  ferguson demos --expert guided --fields standard/train:0-999 \\
      --out ferguson/guided-v0 --workers 2
  ferguson demos --expert guided+margin=0.5 --fields traps/train:0-99 \\
      --observation rays --out traps-v1"""


def add_to(demos: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    completes(
        demos.add_argument(
            "--expert",
            required=True,
            metavar="NAME",
            help=f"a planner ({', '.join(PLANNERS)}), with options {OPTIONS}",
        ),
        PLANNER,
    )
    completes(
        demos.add_argument(
            "--fields",
            action="append",
            required=True,
            metavar="SPEC",
            help="for example standard/train:0-999; may be given several times; no files",
        ),
        FIELDS,
    )
    demos.add_argument(
        "--out",
        required=True,
        metavar="DATASET_ID",
        help="for example ferguson/guided-v0; lies below MINARI_DATASETS_PATH, if that is set",
    )
    demos.add_argument(
        "--observation",
        choices=KINDS,
        default=KINDS[0],
        metavar="KIND",
        help=f"as recorded: {', '.join(KINDS)}; default: %(default)s",
    )
    demos.add_argument(
        "--nearest", type=positive, metavar="N", help="obstacles that are seen; default: 12"
    )
    demos.add_argument("--rays", type=positive, metavar="N", help="rays that are cast; default: 64")
    demos.add_argument(
        "--workers", type=workers, default=1, metavar="N", help="worker processes; default: 1"
    )
    demos.add_argument(
        "--fresh",
        action="store_true",
        help="replace a dataset of this id, and another's unfinished work in its place",
    )
    demos.add_argument(
        "--json", action="store_true", help="print one JSON object on what came out, nothing else"
    )
    add_output_options(demos)
    demos.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is flown.

    Raises:
        ValueError: an expert, fields, an environment or a dataset that cannot be; another
            request's work in the way.
    """
    from agents.demonstrations import recording as making
    from agents.demonstrations import work
    from agents.demonstrations.episode import make_environment
    from agents.demonstrations.minari_store import place_of
    from agents.policies.registry import make_policy

    place = place_of(options.out)
    make_policy(options.expert)
    arguments = {"observation": options.observation}
    for name in ("nearest", "rays"):
        if (number := getattr(options, name)) is not None:
            arguments[name] = number
    make_environment(arguments)
    check_number(options.fields, work.MOST)
    request = work.Request(expert=options.expert, specs=tuple(options.fields), arguments=arguments)
    if not options.fresh:
        if place.exists():
            raise ValueError(
                f"there is a dataset {options.out} at {place}; choose another id, or replace it "
                "with --fresh"
            )
        work.open_store(making.work_place(place), request).holds_work()

    terminal = Terminal(quiet=options.quiet, colour=options.colour, as_json=options.json)

    def job() -> int:
        try:
            tally = making.make(
                request, options.out, place, options.workers, options.fresh, terminal
            )
        except KeyboardInterrupt:
            terminal.note(GOES_ON)
            raise
        told = {"dataset": options.out, "place": str(place), **tally.as_json()}
        terminal.show_json(json.dumps(told))
        if not tally.flights:
            sys.stderr.write(f"ferguson: no demonstrations: {tally.sentence()}\n")
            return NO_DEMONSTRATIONS
        terminal.show(tally.sentence())
        terminal.note(f"wrote dataset {options.out} to {place}")
        return DONE

    return job
