"""What a flight costs: processor time of agents beside planners, and beside the paper's solver.

Run it from a checkout:

    .venv/bin/python benchmarks/agent_cost.py --fields standard/validation:0-99 --slow 10

One process and one thread of each library; processor time of all threads counts. Every policy flies
the same fields one at a time, deciding as it does in an evaluation; agents fly them in batches as
well. The paper's planner with SciPy's SLSQP takes half a minute a flight and flies the first
`--slow` of the fields.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numba
import numpy as np
from rich.table import Table

from agents.evaluation.request import is_batched
from agents.flights.batched import fly_batch
from agents.flights.flight import fly
from agents.models import shipped_agents
from agents.policies.interface import Policy
from agents.policies.network_policy import network_policy
from agents.policies.planner_policies import planner_policy
from agents.policies.registry import make_policy
from agents.policies.warm_up import warm_policy
from agents.runtime.terminal import Terminal
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.slsqp import Slsqp
from planners.receding_horizon.paper import RecedingHorizon

SLOW = "multi-start by SLSQP"


def cost(policy: Policy, name: str, fields: Sequence[Field]) -> tuple[list[float], int]:
    """Processor time of each flight [s], and how many arrived."""
    seconds, arrived = [], 0
    for field in fields:
        began = time.process_time()
        arrived += fly(policy, field, 0, name=name).success
        seconds.append(time.process_time() - began)
    return seconds, arrived


def main() -> None:
    """Read the command line, fly, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--fields", default="standard/validation:0-99")
    parser.add_argument("--slow", type=int, default=10)
    parser.add_argument("--policy", action="append")
    given = parser.parse_args()
    numba.set_num_threads(1)
    fields = list(get_fields(given.fields))
    names = given.policy or [
        "best",
        "dagger-ppo",
        "best+shield",
        "multi-start+from=dagger-ppo",
    ]
    rows = []
    for name in [*names, "guided", "pursuit", "multi-start"]:
        policy = make_policy(name)
        warm_policy(name)
        fly(policy, fields[0], 0, name=name)
        rows.append((name, *cost(policy, name, fields)))
        if is_batched(name) and (place := shipped_agents.find_agent(name)) is not None:
            model = network_policy(place).model
            began = time.process_time()
            flights = fly_batch(model, fields)
            each = (time.process_time() - began) / len(fields)
            arrived = sum(flight.success for flight in flights)
            rows.append((f"{name}, in batches", [each] * len(fields), arrived))
    reference = planner_policy(RecedingHorizon(solver=ByExchange(Slsqp())))
    rows.append((SLOW, *cost(reference, SLOW, fields[: given.slow])))
    slow = float(np.median(rows[-1][1]))
    table = Table("policy", "flights", "arrived", "ms a flight, median", "90 %", f"{SLOW} takes")
    for name, seconds, arrived in rows:
        median, most = np.quantile(seconds, [0.5, 0.9])
        cells = (f"{1e3 * median:.1f}", f"{1e3 * most:.1f}", f"{slow / median:,.0f} times that")
        table.add_row(name, str(len(seconds)), str(arrived), *cells)
    Terminal().show(table)


if __name__ == "__main__":
    main()
