"""`ferguson animate`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.cli.arguments import add_output_options, seed
from agents.cli.completion import FILE, ONE_FIELD, PLANNER, completes
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.transition import initial_state
from planners.registry import PLANNERS

HELP = "show a flight as it is decided, a GIF"
DESCRIPTION = """\
Fly a planner through one field and write a GIF: in each window the first guesses, the plan that
came of them, what it sees and the way left behind it, then the segment that is flown."""
EPILOG = """\
examples:
  ferguson animate paper:3 --policy guided --out flight.gif
  ferguson animate traps/train:0 --policy guided+sensing=20 --out sensed.gif"""


def add_to(animate: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    completes(
        animate.add_argument(
            "field", metavar="FIELD", help="for example paper:1, standard/test:7 or my_field.json"
        ),
        ONE_FIELD,
    )
    completes(
        animate.add_argument(
            "--policy",
            required=True,
            metavar="NAME",
            help=f"one of {', '.join(PLANNERS)}, with options or without",
        ),
        PLANNER,
    )
    completes(
        animate.add_argument("--out", type=Path, required=True, metavar="FILE", help="a .gif"), FILE
    )
    animate.add_argument(
        "--seed", type=seed, default=0, metavar="N", help="of the policy; default: 0"
    )
    add_output_options(animate)
    animate.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is flown.

    Raises:
        ValueError: a policy, a field or a file that cannot be.
    """
    from agents.cli.compile_notice import announce_compilation
    from agents.flights.flight import fly
    from agents.plots.animation.animation import animate
    from agents.plots.animation.gif import SUFFIX
    from agents.plots.flight_grid import check_target
    from agents.policies.registry import make_policy
    from agents.policies.spec import PolicySpec

    make_policy(options.policy)  # refuses unknown names
    if not PolicySpec.parse(options.policy).is_planner:
        raise ValueError(
            f"an animation shows how a planner decides, and {options.policy!r} is an agent, which "
            f"plans nothing; planners are {', '.join(PLANNERS)}"
        )
    field = get_field(options.field)
    initial_state(field)
    check_target(options.out, "animation", [SUFFIX])
    terminal = Terminal(quiet=options.quiet, colour=options.colour)

    def job() -> int:
        with announce_compilation(terminal):
            flight = fly(options.policy, field, options.seed)
        with terminal.still_bar() as progress:
            frames = animate(flight, options.out, progress)
        terminal.show(
            f"{flight.policy} on {field.name}, seed {flight.seed}: {flight.outcome.sentence}, "
            f"{len(flight.control)} segments, {flight.length:.4f} m"
        )
        terminal.note(f"wrote {frames} frames to {options.out}")
        return DONE

    return job
