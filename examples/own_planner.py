"""A custom planner, compared with the planners of the project on the same fields.

Run it from a checkout; it takes seconds:

    .venv/bin/python examples/own_planner.py
    .venv/bin/python examples/own_planner.py --fields forest/train:0-9 --beside multi-start

`Shooting` samples random chains of segments towards the goal, keeps the feasible ones and flies the
first segment of the best: a receding horizon without an optimiser. It flies in the same environment
as all planners, which refuses segments that are not certified along their whole length. The table
shows what each policy knows of the obstacles, successes, and gaps to the field's shortest path,
which is computed exactly. `docs/planners.md` describes the planners of the other rows.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np

from agents.flights import Flight, fly
from agents.policies import Policy, make_policy, planner_policy
from ferguson_gym.curves.arc_length import length
from ferguson_gym.world import Field, get_fields, is_feasible
from planners.interface import Decision, Knowledge, Plan, State, WindowReport, knowledge_of
from planners.optimization.initial_guesses import catmull_rom
from planners.rollout import ends_on_goal, remaining_plan, roll_out


@dataclass(frozen=True)
class Shooting:
    """Random chains towards the goal, of which the shortest feasible one is kept."""

    knows = Knowledge.NEARBY  # it looks three segments ahead; without this line: the whole field

    chains: int = 1000
    turn: float = 0.8  # of each step against the one before, standard deviation [rad]

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Decide, fly, decide again: what every planner that decides step by step does."""
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """The next segments; those planned before stay if no chain is better."""
        began, vehicle = time.perf_counter(), state.vehicle
        stream = np.random.default_rng([seed, vehicle.segments])  # the same seed, the same flight
        to_goal, longest = field.goal - vehicle.position, field.limits.longest
        shape = self.chains, int(np.clip(np.linalg.norm(to_goal) // (longest / 3.0), 1, 3))

        turns = stream.normal(0.0, self.turn, shape)
        angles = np.arctan2(to_goal[1], to_goal[0]) + turns.cumsum(axis=1)
        steps = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        steps *= stream.uniform(0.27, 0.8, shape)[..., None] * longest
        points = vehicle.position + np.insert(steps.cumsum(axis=1), 0, 0.0, axis=1)
        points[::4, -1] = field.goal  # a quarter of them try to arrive
        chains = catmull_rom(vehicle, points)  # with derivatives: (chains, segments, 4, 2)
        chains = chains[
            is_feasible(chains, field, tolerance=0.1 * field.limits.tolerance).all(axis=1)
        ]

        best = chains[cost(chains, field).argmin()] if len(chains) else None
        rest = remaining_plan(field, state) if ends_on_goal(field, state) else None
        if rest is not None and (best is None or cost(rest[0], field) < cost(best, field)):
            best = rest[0]
        seconds = time.perf_counter() - began
        return Decision(best, WindowReport(step=vehicle.segments, seconds=seconds))


def cost(chains: np.ndarray, field: Field) -> np.ndarray:
    """Length of chains (..., n, 4, 2) and the straight distance from their ends to the goal [m]."""
    left = np.linalg.norm(field.goal - chains[..., -1, 1, :], axis=-1)
    return length(chains).sum(axis=-1) + left


def compare(policies: dict[str, Policy], fields: list[Field]) -> list[Flight]:
    """Fly all policies through all fields, in the environment."""
    return [
        fly(policy, field, seed=0, name=name)
        for name, policy in policies.items()
        for field in fields
    ]


def row(flights: list[Flight], knows: Knowledge) -> str:
    """A table row for one policy and what it knows; gaps are over successful flights."""
    gaps = [100.0 * flight.gap for flight in flights if flight.gap is not None]
    told = f"{np.median(gaps):12.2f} %{max(gaps):10.2f} %" if gaps else f"{'-':>14}{'-':>12}"
    arrived = sum(flight.success for flight in flights)
    milliseconds = 1e3 * np.median([flight.seconds for flight in flights])
    name = f"{flights[0].policy:18}{knows.label:13}"
    return f"{name}{arrived:5}/{len(flights):<5}{told}{milliseconds:10.0f} ms"


def main(fields: str, beside: list[str]) -> None:
    """Compare and print the table."""
    policies = {
        "shooting": planner_policy(Shooting()),
        **{name: make_policy(name) for name in beside},
    }
    flights = compare(policies, list(get_fields(fields)))
    print(f"{fields:18}{'knows':15}arrived   gap, median     worst     a flight")
    for name, policy in policies.items():
        print(row([flight for flight in flights if flight.policy == name], knowledge_of(policy)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--fields", default="standard/train:0-19")
    parser.add_argument("--beside", nargs="+", default=["guided", "shortest"], metavar="PLANNER")
    main(**vars(parser.parse_args()))
