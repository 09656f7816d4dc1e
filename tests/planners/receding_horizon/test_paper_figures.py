"""The figures of the paper's Table I, over 30 seeds: minutes, hence slow."""

import csv
from pathlib import Path

import numpy as np
import pytest

from agents.evaluation.run import evaluate
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.paper_fields import TABLE_I


@pytest.mark.slow
def test_multi_start_gives_the_papers_figures(tmp_path: Path) -> None:
    evaluate(["multi-start"], list(get_fields("paper:1-4")), range(30), tmp_path, workers=2)
    with (tmp_path / "flights.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    for number in range(1, 5):
        name = f"paper:{number}"
        flown = [row for row in table if row["field"] == name]
        arrived = [row for row in flown if row["success"] == "1"]
        lengths = np.array([float(row["length"]) for row in arrived])
        segments = np.array([int(row["segments"]) for row in arrived])
        paper = TABLE_I["multi-start", name].length
        assert paper is not None
        assert len(flown) == 30
        assert len(arrived) >= 28
        assert (lengths <= 1.01 * paper).sum() >= 0.3 * 30
        assert lengths.min() < paper
        assert 10 <= np.median(segments) <= 12
