"""`ferguson plan`: its arguments and checks."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser, duration, metres, spacing
from agents.cli.completion import FILE, POLICY
from agents.runtime.interrupts import defer_interrupt
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.world import get_field, initial_state

NO_PATH = 1
SPACING = 0.5
"""Default distance between the points of `--out` [m]."""
HELP = "plan a path through one field"
DESCRIPTION = """\
Plan a path through one field; print its length, clearance and smallest turn radius, and the
planning windows or the route from which it was made. Exit status 1: no path was found."""
EPILOG = """\
examples:
  ferguson plan paper:2 --planner multi-start --plot flight.png
  ferguson plan my_field.json --planner shortest --inflate 0.3
  ferguson plan paper:1 --planner guided --limit longest=30 --limit gate=1
  ferguson plan traps/train:1 --planner guided --sensing-range 20
  ferguson plan standard/test:3 --planner multi-start --start-from best
  ferguson plan paper:1 --planner guided --json
  ferguson plan dense/test:0 --planner multi-start --deadline 0.2
  ferguson plan my_field.json --planner guided --out path.csv --spacing 1"""


def add_to(plan: Parser) -> None:
    """Add the arguments."""
    shared.add_field(plan)
    shared.add_planner(plan, "--planner", required=True)
    shared.add_seed(plan, "seed of the planner")
    shared.add_field_changes(plan)
    plan.add_argument(
        "--sensing-range",
        type=metres,
        metavar="R",
        help="hide obstacles farther than R metres from the path flown so far; at least "
        "the longest segment (single-start, multi-start, guided, pursuit)",
    )
    plan.add_argument(
        "--backtrack",
        action="store_true",
        help="when stuck, follow the shortest path out of the dead end (planners as for "
        "--sensing-range)",
    )
    plan.add_argument(
        "--turn-radius",
        type=metres,
        metavar="R",
        help="keep a turn radius of at least R metres (guided)",
    )
    plan.add_argument(
        "--start-from",
        metavar="POLICY",
        help="use the segments that another policy would fly as initial guesses "
        "(single-start, multi-start)",
        complete=POLICY,
    )
    plan.add_argument(
        "--deadline",
        type=duration,
        metavar="SECONDS",
        help="stop after so many seconds, with the best certified path so far (all planners but "
        "shortest, voronoi and astar)",
    )
    plan.add_argument(
        "--no-reference",
        dest="reference",
        action="store_false",
        help="do not compute the exact shortest path, and report no gap",
    )
    shared.add_json(plan, "print only one JSON object")
    plot_help = "draw the plan (png, pdf, svg)"
    plan.add_argument("--plot", type=Path, metavar="FILE", help=plot_help, complete=FILE)
    plan.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="write the path as points at even distances, with heading and curvature (csv, json)",
        complete=FILE,
    )
    plan.add_argument(
        "--spacing",
        type=spacing,
        metavar="METRES",
        help=f"upper limit of the distance between the points of --out; default: {SPACING:g}",
    )
    shared.add_output_options(plan)
    plan.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before planning.

    Raises:
        ValueError: the planner, the field or a file to write is not valid.
    """
    from agents.cli import plan_report
    from agents.flights.path_file import SUFFIXES
    from agents.models import shipped_agents
    from agents.plots.flight_grid import check_target
    from agents.policies import PolicySpec
    from agents.policies.registry import make_planner
    from agents.policies.warm_up import warm
    from ferguson_gym.curves.sampling import MOST
    from planners.deadline import check_deadline

    agents = PolicySpec.parse(options.planner).agents
    if any(shipped_agents.find_agent(agent) for agent in agents):
        raise ValueError(
            f"{options.planner!r} is an agent, not a planner; use ferguson evaluate "
            f"--policy {options.planner} --fields {options.field} --out DIR"
        )
    spec = PolicySpec.parse_planner(options.planner).with_options(
        backtrack=options.backtrack,
        sensing=options.sensing_range,
        turn=options.turn_radius,
        start_from=options.start_from,
    )
    name = str(spec)
    planner = make_planner(spec)  # raises if an option does not fit
    if options.deadline is not None:
        check_deadline(planner, name)
    changes = shared.field_changes(options)
    field = changes.apply(get_field(options.field))
    initial_state(field)  # raises if no flight can begin
    spec.check(field)
    if options.plot is not None:
        check_target(options.plot)
    distance = SPACING if options.spacing is None else options.spacing
    if options.out is not None:
        check_target(options.out, "path", SUFFIXES)
        longest = field.limits.segments * field.limits.longest
        if distance * (MOST - 1) < longest:
            raise ValueError(
                f"--spacing {distance:g} may give more than {MOST} points; from "
                f"{longest / (MOST - 1):.2g} m on it does not"
            )
    elif options.spacing is not None:
        raise ValueError(f"--spacing {distance:g} is for --out FILE, which is missing")

    def job() -> int:
        shared.note_touching([field], terminal)
        planner = warm(name)
        with defer_interrupt():
            report = plan_report.plan(
                *(planner, name, field, options.seed),
                reference=options.reference,
                deadline=options.deadline,
                changes=changes,
            )
        if options.json:
            terminal.show_json(report.to_json())
        else:
            terminal.show(*report.lines(windows=not options.quiet))
        if options.plot is not None:
            report.draw(options.plot)
            terminal.note(f"wrote {options.plot}")
        if options.out is not None:
            points = report.write_path(options.out, distance)
            what = "points" if report.plan.success else "points of the path so far"
            terminal.note(
                f"wrote {points} {what} to {options.out}"
                if points
                else f"no path, so nothing is written to {options.out}"
            )
        return DONE if report.plan.success else NO_PATH

    return job
