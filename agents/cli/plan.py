"""`ferguson plan`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.cli.arguments import add_output_options, metres, seed
from agents.cli.completion import FILE, ONE_FIELD, PLANNER, POLICY, completes
from agents.runtime.interrupts import defer_interrupt
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.transition import initial_state
from planners.registry import OPTIONS, PLANNERS

NO_PATH = 1
HELP = "plan one field"
DESCRIPTION = """\
Plan one field; print the plan, and the windows or the route it came from. Exit status 1: no path
was found."""
EPILOG = """\
examples:
  ferguson plan paper:2 --planner multi-start --plot flight.png
  ferguson plan my_field.json --planner shortest
  ferguson plan traps/train:1 --planner guided --sensing-range 20
  ferguson plan standard/test:3 --planner multi-start --start-from best
  ferguson plan paper:1 --planner guided --json"""


def add_to(plan: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    completes(
        plan.add_argument(
            "field", metavar="FIELD", help="for example paper:1, standard/test:7 or my_field.json"
        ),
        ONE_FIELD,
    )
    completes(
        plan.add_argument(
            "--planner",
            required=True,
            metavar="NAME",
            help=f"one of {', '.join(PLANNERS)}, with options or without: {OPTIONS}",
        ),
        PLANNER,
    )
    plan.add_argument(
        "--seed", type=seed, default=0, metavar="N", help="of the planner; default: 0"
    )
    plan.add_argument(
        "--sensing-range",
        type=metres,
        metavar="R",
        help="know only the obstacles within R metres of where the vehicle has been; at least 15, "
        "for single-start, multi-start, guided and pursuit",
    )
    plan.add_argument(
        "--backtrack", action="store_true", help="out of a dead end, be led along the shortest way"
    )
    plan.add_argument(
        "--turn-radius", type=metres, metavar="R", help="turn no sharper than R metres (guided)"
    )
    completes(
        plan.add_argument(
            "--start-from",
            metavar="POLICY",
            help="start from what an agent, or any other policy, would fly (single-start, "
            "multi-start)",
        ),
        POLICY,
    )
    plan.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    completes(
        plan.add_argument(
            "--plot", type=Path, metavar="FILE", help="write a picture (png, pdf, svg)"
        ),
        FILE,
    )
    add_output_options(plan)
    plan.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is planned.

    Raises:
        ValueError: a planner, a field or a picture that cannot be.
    """
    from agents.cli import plan_report
    from agents.cli.compile_notice import announce_compilation
    from agents.models import shipped_agents
    from agents.plots.flight_grid import check_target
    from agents.policies.registry import make_planner
    from agents.policies.spec import PolicySpec
    from agents.policies.warm_up import warm

    agents = PolicySpec.parse(options.planner).agents
    if any(shipped_agents.find_agent(agent) for agent in agents):
        raise ValueError(
            f"{options.planner!r} is an agent, which plans nothing; fly it by ferguson evaluate "
            f"--policy {options.planner} --fields {options.field} --out DIR"
        )
    spec = PolicySpec.parse_planner(options.planner).with_options(
        backtrack=options.backtrack,
        sensing=options.sensing_range,
        turn=options.turn_radius,
        start_from=options.start_from,
    )
    name = str(spec)
    make_planner(spec)  # raises if an option does not fit
    field = get_field(options.field)
    initial_state(field)  # refuses what cannot be flown
    if options.plot is not None:
        check_target(options.plot)
    terminal = Terminal(quiet=options.quiet, colour=options.colour, as_json=options.json)

    def job() -> int:
        with announce_compilation(terminal):
            planner = warm(name)
        with defer_interrupt():
            report = plan_report.plan(planner, name, field, options.seed)
        if options.json:
            terminal.show_json(report.to_json())
        else:
            terminal.show(*report.lines(windows=not options.quiet))
        if options.plot is not None:
            report.draw(options.plot)
            terminal.note(f"wrote {options.plot}")
        return DONE if report.plan.success else NO_PATH

    return job
