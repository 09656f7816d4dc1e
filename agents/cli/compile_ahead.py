"""`ferguson compile`: its arguments and checks."""

from __future__ import annotations

import argparse
import time

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser
from agents.cli.completion import POLICY
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal

HELP = "compile numerical kernels ahead of the first run"
DESCRIPTION = """\
Compile the numerical kernels of the environment, and of policies if some are named, into the cache
from which later runs load them; for example while a container image is built. NUMBA_CACHE_DIR names
the directory of the cache, which the user of later runs must be able to write."""
EPILOG = """\
examples:
  ferguson compile
  ferguson compile --policy guided --policy best"""


def add_to(compile_: Parser) -> None:
    """Add the arguments."""
    compile_.add_argument(
        "--policy",
        action="append",
        default=[],
        metavar="P",
        help="a planner or an agent whose kernels to compile too; may be given several times",
        complete=POLICY,
    )
    shared.add_output_options(compile_)
    compile_.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before compiling.

    Raises:
        ValueError: a policy is not valid.
    """
    from agents.flights import fly
    from agents.policies import make_policy
    from agents.runtime.kernels import compile_kernels, small_field

    for policy in options.policy:
        make_policy(policy)

    def job() -> None:
        began = time.perf_counter()
        compile_kernels()
        for policy in options.policy:
            fly(policy, small_field())
        terminal.show(f"kernels are ready after {time.perf_counter() - began:.1f} s")

    return job
