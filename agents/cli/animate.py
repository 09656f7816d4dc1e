"""`ferguson animate`: its arguments and checks."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser
from agents.cli.completion import FILE
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from ferguson_gym.world import get_field, initial_state
from planners import PLANNERS

HELP = "animate a planner's flight as a GIF"
DESCRIPTION = """\
Fly a planner through one field and write a GIF. For each planning window it shows the initial
guesses, the resulting plan, the obstacles in its range, and the shortest path from the plan's end
to the goal. Then it shows the segment that is flown."""
EPILOG = """\
examples:
  ferguson animate paper:3 --policy guided --out flight.gif
  ferguson animate traps/train:0 --policy guided+sensing=20 --out sensed.gif"""


def add_to(animate: Parser) -> None:
    """Add the arguments."""
    shared.add_field(animate)
    shared.add_planner(animate, "--policy", required=True)
    animate.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="the GIF to write", complete=FILE
    )
    shared.add_seed(animate, "seed of the policy")
    shared.add_field_changes(animate)
    shared.add_output_options(animate)
    animate.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before the flight.

    Raises:
        ValueError: the policy, the field or the file is not valid.
    """
    from agents.flights import fly
    from agents.plots.animation.animation import animate
    from agents.plots.animation.gif import SUFFIX
    from agents.plots.flight_grid import check_target
    from agents.policies import PolicySpec, make_policy

    make_policy(options.policy)  # raises for unknown names
    if not PolicySpec.parse(options.policy).is_planner:
        raise ValueError(
            f"only planners can be animated, and {options.policy!r} is an agent; "
            f"planners are {', '.join(PLANNERS)}"
        )
    changes = shared.field_changes(options)
    field = changes.apply(get_field(options.field))
    initial_state(field)
    check_target(options.out, "animation", [SUFFIX])

    def job() -> None:
        flight = fly(options.policy, field, options.seed)
        with terminal.still_bar() as progress:
            frames = animate(flight, options.out, progress)
        changed = f" with {changes}" if changes else ""
        terminal.show(
            f"{flight.policy} on {field.name}{changed}, seed {flight.seed}: "
            f"{flight.outcome.sentence}, {len(flight.control)} segments, "
            f"{flight.length:.4f} m"
        )
        terminal.note(f"wrote {frames} frames to {options.out}")

    return job
