"""`ferguson demos`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
import sys

from agents.arguments import DONE, Job, positive
from ferguson_gym.observations import KINDS
from planners.catalog import OPTIONS, PLANNERS

NO_DEMONSTRATIONS = 1


def add_to(demos: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    demos.add_argument(
        "--expert",
        required=True,
        metavar="NAME",
        help=f"a planner ({', '.join(PLANNERS)}), with options {OPTIONS}",
    )
    demos.add_argument(
        "--fields",
        action="append",
        required=True,
        metavar="SPEC",
        help="for example standard/train:0-999; may be given several times; no files",
    )
    demos.add_argument(
        "--out",
        required=True,
        metavar="DATASET_ID",
        help="for example ferguson/guided-v0; lies below MINARI_DATASETS_PATH, if that is set",
    )
    demos.add_argument(
        "--observation", choices=KINDS, default=KINDS[0], help="as recorded; default: %(default)s"
    )
    demos.add_argument(
        "--nearest", type=positive, metavar="N", help="obstacles that are seen; default: 12"
    )
    demos.add_argument("--rays", type=positive, metavar="N", help="default: 64")
    demos.add_argument(
        "--workers", type=positive, default=1, metavar="N", help="worker processes; default: 1"
    )
    demos.add_argument(
        "--fresh",
        action="store_true",
        help="replace a dataset of this id, and another's unfinished work in its place",
    )
    demos.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is flown.

    Raises:
        ValueError: an expert, fields, an environment or a dataset that cannot be; another
            request's work in the way.
    """
    from agents import demonstrations_making as making
    from agents import demonstrations_work as work
    from agents.demonstrations_episodes import make_environment
    from agents.demonstrations_minari import place_of
    from agents.policies import make_policy

    place = place_of(options.out)
    make_policy(options.expert)
    arguments = {"observation": options.observation}
    for name in ("nearest", "rays"):
        if (number := getattr(options, name)) is not None:
            arguments[name] = number
    make_environment(arguments)
    request = work.Request(expert=options.expert, specs=tuple(options.fields), arguments=arguments)
    if not options.fresh:
        if place.exists():
            raise ValueError(
                f"there is a dataset {options.out} at {place}; choose another id, or replace it "
                "with --fresh"
            )
        work.check(making.work_place(place), request)

    def job() -> int:
        try:
            tally = making.make(request, options.out, place, options.workers, options.fresh)
        except KeyboardInterrupt:
            sys.stderr.write("ferguson: the same command goes on where this one stopped\n")
            raise
        if not tally.flights:
            sys.stderr.write(f"ferguson: no demonstrations: {tally.sentence()}\n")
            return NO_DEMONSTRATIONS
        sys.stdout.write(f"{tally.sentence()}\nwrote dataset {options.out} to {place}\n")
        return DONE

    return job
