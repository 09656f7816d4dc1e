"""Imitation at a tiny scale: its hyperparameters, a command line, and demonstrations in memory."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from agents.demonstrations.reading import Demonstrations
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field_names import get_fields
from planners.interface import initial_state
from planners.receding_horizon.pursuit import Pursuit

CHOSEN, REPORTED = "sparse/validation:0-2", "sparse/validation:3-5"
TINY: dict[str, Any] = {
    "n_envs": 3,
    "n_timesteps": 300,
    "eval_freq": 60,
    "policy": "deepsets-mixture",
    "policy_kwargs": {
        "net_arch": [8],
        "components": 2,
        "features_extractor_kwargs": {"width": 4},
    },
    "env_kwargs": {"suite": "sparse", "observation": "both", "nearest": 3, "rays": 5},
    "first": 2,
    "updates": 4,
    "batch_size": 16,
    "learning_rate": "lin_1e-2",
}

Command = Callable[..., list[str]]


def command_in(directory: Path) -> Command:
    """The command line of a tiny training in `directory`/out."""
    import yaml

    def arguments(algorithm: str, *more: str, **changes: Any) -> list[str]:
        config = directory / f"{algorithm}.yml"
        config.write_text(yaml.safe_dump({ENVIRONMENT_ID: {**TINY, **changes}}))
        where = ["--config", str(config), "--out", str(directory / "out")]
        fields = ["--choose-on", CHOSEN, "--report-on", REPORTED]
        return ["train", algorithm, *where, *fields, *more]

    return arguments


class Flights:
    """Demonstrations in memory, flown by pursuit."""

    flight = Demonstrations.flight

    def __init__(self, number: int) -> None:
        self.fields = tuple(f"sparse/train:{k}" for k in range(number))
        flown = []
        for field in (one for name in self.fields for one in get_fields(name)):
            plan = Pursuit().plan(field, initial_state(field), 0)
            vehicles = [state.vehicle for state in plan.states]
            flown.append(
                [
                    encode(control, vehicle.position, vehicle.derivative)
                    for control, vehicle in zip(plan.control, vehicles[:-1], strict=True)
                ]
            )
        self.actions = np.array([action for one in flown for action in one]).reshape(-1, 4)
        self.offsets = np.cumsum([0, *map(len, flown)])


def curve_of(directory: Path) -> list[dict[str, str]]:
    """The learning curve of a run, without times."""
    with (directory / "curve.csv").open() as file:
        return [{**row, "minutes": ""} for row in csv.DictReader(file)]


def straight_flights(tmp_path: Path) -> Any:
    """Demonstrations: six flights of two straight segments each."""
    goal = {"centers": [], "radii": [], "goal": [12.8, 12.8]}
    (tmp_path / "near.json").write_text(json.dumps(goal))

    class Flights:
        flight = Demonstrations.flight
        fields = (str(tmp_path / "near.json"),) * 6
        actions = np.zeros((12, 4), np.float32)
        offsets = np.arange(0, 14, 2)

    return Flights()
