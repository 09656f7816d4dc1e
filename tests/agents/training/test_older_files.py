"""Datasets, models and unfinished trainings written at commit 98af455 still load and resume.

They are in `tests/data/saved_at_98af455`: a dataset of two flights, a model that was cloned from
it, and the same training interrupted after the first of three evaluations. At that commit all
modules lay in flat folders under other names.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import torch

from agents.cli.main import main
from agents.flights.batched import fly_batch
from agents.models import loading
from ferguson_gym.world.field_names import get_field
from tests.support.places import DATA
from tests.support.small_models import same, weights_of

SAVED = DATA / "saved_at_98af455"
DATASET = "before/pursuit-v0"
FIELDS = ["--choose-on", "sparse/train:0-1", "--report-on", "sparse/validation:0-3"]


@pytest.fixture(autouse=True)
def datasets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make Minari find a copy of the old dataset."""
    shutil.copytree(SAVED / "datasets", tmp_path / "datasets")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))


def test_an_old_dataset_is_read_and_replayed() -> None:
    pytest.importorskip("minari")
    from agents.demonstrations.reading import read

    demonstrations = read(DATASET)  # replays the first and the last flight
    assert (demonstrations.expert, len(demonstrations)) == ("pursuit", 2)
    assert demonstrations.fields == ("sparse/train:0", "sparse/train:1")


def test_a_dataset_from_when_discs_were_the_default_is_read_as_one_of_discs(tmp_path: Path) -> None:
    pytest.importorskip("minari")
    from agents.demonstrations.reading import read

    metadata = tmp_path / "datasets" / DATASET / "data/metadata.json"
    known = json.loads(metadata.read_text())
    spec = json.loads(known["env_spec"])
    spec["kwargs"] = {"suite": "sparse"}
    metadata.write_text(json.dumps({**known, "env_spec": json.dumps(spec)}))
    assert read(DATASET).environment == {"observation": "discs", "suite": "sparse"}


def test_an_old_model_flies_as_it_did() -> None:
    (flight,) = fly_batch(loading.load(SAVED / "model"), [get_field("sparse/train:1")])
    # rounding of matrix products differs between machines
    np.testing.assert_allclose(flight.control, np.load(SAVED / "model/flight.npy"), atol=1e-3)


def test_a_training_starts_from_an_old_model(tmp_path: Path) -> None:
    pytest.importorskip("minari")
    start, out = SAVED / "model", tmp_path / "out"
    line = ["train", "bc", "--config", str(SAVED / "bc.yml"), "--demos", DATASET, *FIELDS]
    assert main([*line, "--from", str(start), "--steps", "1", "--out", str(out)]) == 0
    assert not same(weights_of(start), weights_of(out))
    assert loading.load(out).card.policy_kwargs == loading.load(start).card.policy_kwargs


def test_an_old_unfinished_training_resumes(tmp_path: Path) -> None:
    pytest.importorskip("minari")
    out = tmp_path / "out"
    shutil.copytree(SAVED / "unfinished", out)
    line = ["train", "bc", "--config", str(SAVED / "bc.yml"), "--demos", DATASET, *FIELDS]
    assert main([*line, "--out", str(out)]) == 0
    first, *later = loading.load(out).card.curve
    assert (first["steps"], first["minutes"]) == (12_800, 0.115)  # as it was written then
    assert [row["steps"] for row in later] == [25_600, 38_400]
    # Trainings that were not interrupted end 3.7 apart on two machines, since rounding grows with
    # every update; the two thirds that are left part by 0.07.
    ended, then, now = (
        torch.cat([weights.flatten() for weights in weights_of(place)])
        for place in (SAVED / "model", SAVED / "unfinished/best", out)
    )
    assert torch.dist(now, ended) < 0.1 * torch.dist(now, then)
