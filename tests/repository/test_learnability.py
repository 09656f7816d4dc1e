"""The learnability benchmark trains, keeps the best, and goes on where it stopped."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT

TRAINING = """
import sys
from pathlib import Path
sys.path.insert(0, "benchmarks")
import learnability
learnability.EVERY = 8192
learnability.CHOSEN_ON = learnability.REPORTED_ON = "sparse/validation:0-3"
learnability.train(float(sys.argv[1]), 0, Path(sys.argv[2]))
"""


def train(minutes: float, out: Path) -> str:
    pytest.importorskip("stable_baselines3")
    return subprocess.run(
        [sys.executable, "-c", TRAINING, str(minutes), str(out)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@pytest.mark.slow
def test_training_passes_through_its_phases_and_goes_on(tmp_path: Path) -> None:
    assert "SPL" in train(0.5, tmp_path)
    first = json.loads((tmp_path / "curve.json").read_text())
    score = json.loads((tmp_path / "score.json").read_text())
    assert sum(score["outcomes"]) == 4
    assert {path.name for path in tmp_path.iterdir()} == {"best.zip", "curve.json", "score.json"}
    train(1.0, tmp_path)
    curve = json.loads((tmp_path / "curve.json").read_text())
    assert curve[: len(first)] == first
    assert len(curve) > len(first)
    steps, minutes = ([point[key] for point in curve] for key in ("steps", "minutes"))
    assert steps == sorted(steps)
    assert minutes == sorted(minutes)
