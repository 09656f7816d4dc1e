"""Planners registered in a process are known to its workers, however they were defined."""

import csv
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from joblib import delayed

from agents.runtime.worker_processes import map_in_processes
from planners import PLANNERS, make, register
from planners.receding_horizon import Pursuit
from tests.support.places import ROOT

SCRIPT = """
import sys
from agents.cli.main import main
from planners import register
from planners.receding_horizon import Pursuit

class Mine(Pursuit):
    pass

if __name__ == "__main__":
    register("mine", Mine)
    sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    with patch.dict(PLANNERS):
        yield


def test_a_local_function_is_sent_to_workers() -> None:
    stride = 8.0

    def mine() -> Pursuit:
        return Pursuit(stride=stride)

    register("mine", mine)
    with map_in_processes([delayed(make)("mine") for _ in range(4)], 2) as results:
        assert [found.stride for found in results] == 4 * [stride]


def test_what_cannot_be_sent_is_named() -> None:
    lock: Any = threading.Lock()
    register("mine", lambda: lock)
    with (
        pytest.raises(OSError, match="planner 'mine' cannot be sent to worker processes"),
        map_in_processes([delayed(make)("mine")], 2),
    ):
        pass


def test_planners_of_a_script_and_of_a_package_fly_in_worker_processes(tmp_path: Path) -> None:
    script, packages, out = tmp_path / "own.py", tmp_path / "packages", tmp_path / "out"
    script.write_text(SCRIPT)
    metadata = packages / "theirs-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[ferguson.planners]\ntheirs = their_code:Theirs\n")
    (packages / "their_code.py").write_text(
        "from planners.receding_horizon import Pursuit\nclass Theirs(Pursuit):\n    pass\n"
    )
    names = ("pursuit", "mine", "theirs")
    policies = [word for name in names for word in ("--policy", name)]
    command = ["evaluate", *policies, "--fields", "sparse/train:0-1", "--workers", "2"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(packages)])}
    done = subprocess.run(
        [sys.executable, str(script), *command, "--out", str(out), "--quiet"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    with (out / "flights.csv").open(newline="", encoding="utf-8") as file:
        _, *rows = csv.reader(file)
    flights = {name: [row[1:] for row in rows if row[0] == name] for name in names}
    assert len(flights["mine"]) == 2
    assert flights["mine"] == flights["theirs"] == flights["pursuit"]
