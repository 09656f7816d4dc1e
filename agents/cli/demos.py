"""`ferguson demos`: its arguments and checks."""

from __future__ import annotations

import argparse
import json
import sys

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser, check_number, positive
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing

NO_DEMONSTRATIONS = 1
HELP = "record a planner's flights as a dataset"
DESCRIPTION = f"""\
Fly a planner through fields in the environment and write its flights as a Minari dataset. Failed
flights are left out and counted. After an interruption the same command resumes. Exit status 1: no
flight succeeded. To install Minari: {installing("demos")}"""
EPILOG = """\
examples:
  ferguson demos --expert guided --fields standard/train:0-999 \\
      --out ferguson/guided-v0 --workers 2
  ferguson demos --expert guided+margin=0.5 --fields traps/train:0-99 \\
      --observation both --out traps-v1"""


def add_to(demos: Parser) -> None:
    """Add the arguments."""
    shared.add_planner(demos, "--expert", required=True)
    shared.add_fields(
        demos, "fields to fly, for example standard/train:0-999, by name, not as files"
    )
    demos.add_argument(
        "--out",
        required=True,
        metavar="DATASET_ID",
        help="id of the dataset, for example ferguson/guided-v0; it is written to the directory "
        "MINARI_DATASETS_PATH, by default ~/.minari/datasets",
    )
    shared.add_observation(demos)
    demos.add_argument(
        "--nearest", type=positive, metavar="N", help="number of observed obstacles; default: 12"
    )
    demos.add_argument("--rays", type=positive, metavar="N", help="number of rays; default: 64")
    demos.add_argument(
        "--flat",
        action="store_true",
        help="record each observation as one vector instead of a dictionary",
    )
    shared.add_workers(demos)
    fresh_help = "start over: replace a dataset of this id, or an unfinished recording"
    demos.add_argument("--fresh", action="store_true", help=fresh_help)
    shared.add_json(demos, "print only one JSON object with the numbers of flights")
    shared.add_output_options(demos)
    demos.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before the flights.

    Raises:
        ValueError: the expert, fields, environment or dataset is not valid, or the unfinished work
            of another request is in the way.
    """
    from agents.demonstrations import recording, work
    from agents.demonstrations.episode import make_environment
    from agents.demonstrations.minari_store import place_of
    from agents.policies import make_policy

    place = place_of(options.out)
    make_policy(options.expert)
    arguments = {"observation": options.observation}
    if options.flat:
        arguments["flat"] = True
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
        work.open_store(recording.work_place(place), request).holds_work()

    def job() -> int:
        tally = recording.make(
            request, options.out, place, options.workers, options.fresh, terminal
        )
        report = {"dataset": options.out, "place": str(place), **tally.as_json()}
        terminal.show_json(json.dumps(report))
        if not tally.flights:
            sys.stderr.write(f"ferguson: no demonstrations: {tally.sentence()}\n")
            return NO_DEMONSTRATIONS
        terminal.show(tally.sentence())
        terminal.note(f"wrote dataset {options.out} to {place}")
        return DONE

    return job
