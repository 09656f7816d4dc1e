"""Models on disk: a loaded model flies like the saved one, and damaged files are refused."""

import io
import json
import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch

from agents.cli.main import main
from agents.flights.batched import fly_batch
from agents.models import loading
from ferguson_gym.world.field_names import get_fields
from tests.support.places import ROOT
from tests.support.small_models import DISCS, card_of, saved

FIELDS = "sparse/train:0-5"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("models") / "ace")


@pytest.fixture
def copy(model: Path, tmp_path: Path) -> Path:
    """A model to break."""
    for file in model.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


PROGRAM = """
import sys
import numpy as np
from agents.flights.flight import fly
from ferguson_gym.world.field_names import get_fields
flights = [fly(sys.argv[1], field, 0) for field in get_fields(sys.argv[2])]
np.save(sys.argv[3], np.concatenate([flight.control for flight in flights]))
"""


def test_a_fresh_process_flies_the_flights_of_this_one(model: Path, tmp_path: Path) -> None:
    flown = fly_batch(loading.load(model), get_fields(FIELDS))
    subprocess.run(
        [sys.executable, "-c", PROGRAM, model, FIELDS, tmp_path / "control.npy"],
        check=True,
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "2"},  # the model limits itself to one
    )
    control = np.concatenate([flight.control for flight in flown])
    np.testing.assert_array_equal(np.load(tmp_path / "control.npy"), control)


def refusal(place: Path, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        loading.load(place)


def rewrite(copy: Path, **entries: object) -> None:
    card = json.loads((copy / "model.json").read_text())
    (copy / "model.json").write_text(json.dumps({**card, **entries}))


@pytest.mark.parametrize("name", ["model.zip", "model.json"])
def test_a_missing_file_is_named(copy: Path, name: str) -> None:
    (copy / name).unlink()
    refusal(copy, rf"no model in .*: {name} is missing; a model is a directory with model.zip and")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_a_zip_cut_short_is_refused(copy: Path, share: float) -> None:
    whole = (copy / "model.zip").read_bytes()
    (copy / "model.zip").write_bytes(whole[: int(share * len(whole))])
    refusal(copy, r"model\.zip: .*(cut short|damaged)")


def test_a_foreign_zip_is_refused(copy: Path) -> None:
    with zipfile.ZipFile(copy / "model.zip", "w") as archive:
        archive.writestr("holiday.txt", "sun")
    refusal(copy, r"model\.zip: no weights in it: cut short, or not saved by this package")


class Bomb:
    """Leaves a file behind if it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple:
        return Path.touch, (self.trace,)


def test_no_code_in_a_model_is_run(copy: Path, tmp_path: Path) -> None:
    trace = tmp_path / "exploded"
    packed = io.BytesIO()
    torch.save({"log_std": Bomb(trace)}, packed)
    for bomb in (packed.getvalue(), pickle.dumps(Bomb(trace))):
        with zipfile.ZipFile(copy / "model.zip", "w") as archive:
            archive.writestr("policy.pth", bomb)
            archive.writestr("data", pickle.dumps(Bomb(trace)))
            archive.writestr("other.pth", bomb)
            archive.writestr("holiday.npy", bomb)
        refusal(copy, r"policy\.pth does not hold weights alone, and nothing else is read")
    assert not trace.exists()
    pickle.loads(pickle.dumps(Bomb(trace)))
    assert trace.exists()  # unpickling does run it


@pytest.mark.parametrize(
    ("entries", "match"),
    [
        ({"environment": {"observation": "rays", "rays": 10}}, "weights are not those of the netw"),
        ({"environment": DISCS}, "weights are not those of the network that model.json describes"),
        ({"environment": {"observation": "radar"}}, "unknown observation 'radar'; kinds are discs"),
        ({"environment": {"wind": 3}}, "unexpected keyword argument 'wind'; known are suite"),
        ({"environment": {"flat": True}}, "agents observe a dictionary.* leave `flat` out"),
        ({"environment": {"fields": "paper:1"}}, "and give `fields` as a number"),
        ({"environment": {"segments": 7}}, "leave `gate` and `segments` out"),
        ({"policy_kwargs": {"net_arch": [24, 25]}}, "size mismatch"),
        ({"policy_kwargs": {"depth": 3}}, "unexpected keyword argument 'depth'"),
        ({"policy_kwargs": {"activation_fn": "wave"}}, "unknown activation_fn 'wave'; known are"),
        ({"policy_kwargs": [24]}, "policy_kwargs should be of type dict"),
        ({"policy": "oracle"}, "unknown policy 'oracle'; policies are mlp"),
        ({"algorithm": "luck"}, "unknown algorithm 'luck'; known are ppo"),
        ({"algorithm": "tqc"}, "weights are not those of the network"),
        ({"environment_version": "ferguson/ObstacleField-v9 0.1.0"}, "a model for the environment"),
        ({"environment_version": "ferguson/ObstacleField-v0 99.0"}, "newer than .* is installed"),
        ({"colour": "red"}, "not a model's card; it has the entries algorithm, policy"),
        ({"seed": "one"}, "seed should be of type int"),
    ],
)
def test_a_card_that_does_not_fit_is_refused(copy: Path, entries: dict, match: str) -> None:
    rewrite(copy, **entries)
    refusal(copy, match)


@pytest.mark.parametrize("environment", [{}, {"suite": "sparse"}])
def test_a_card_from_when_discs_were_the_default_flies_as_before(
    environment: dict, tmp_path: Path
) -> None:
    discs = {**environment, "observation": "discs"}
    saved(tmp_path / "named", card_of(environment=discs))
    saved(tmp_path / "left-out", card_of(environment=discs))
    rewrite(tmp_path / "left-out", environment=environment)
    known, flown = [loading.load(tmp_path / name) for name in ("named", "left-out")]
    assert flown.card.environment == discs
    for one, other in zip(
        fly_batch(known, get_fields(FIELDS)), fly_batch(flown, get_fields(FIELDS)), strict=True
    ):
        np.testing.assert_array_equal(one.control, other.control)


def test_a_new_card_names_the_observation_that_was_the_default(tmp_path: Path) -> None:
    saved(tmp_path, card_of(environment={"rays": 8}))
    assert loading.load(tmp_path).card.environment == {"observation": "rays", "rays": 8}


@pytest.mark.parametrize("text", ["", '{"algorithm": "pp', "[" * 100_000, "[]", "\x00"])
def test_text_that_is_not_a_card_is_refused(copy: Path, text: str) -> None:
    (copy / "model.json").write_text(text)
    refusal(copy, r"model\.json: not ")


def test_the_command_line_refuses_a_damaged_model(
    copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (copy / "model.zip").write_bytes(b"PK")
    out = tmp_path / "out"
    arguments = ["--fields", FIELDS, "--out", str(out)]
    assert main(["evaluate", "--policy", str(copy), *arguments]) == 2
    assert capsys.readouterr().err.endswith("model.zip: not a zip file, or damaged\n")
    assert main(["evaluate", "--policy", str(tmp_path / "nowhere"), *arguments]) == 2
    assert "unknown policy" in capsys.readouterr().err
    assert not out.exists()


def test_an_animation_of_an_agent_is_refused(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "flight.gif"
    assert main(["animate", "paper:1", "--policy", str(model), "--out", str(out)]) == 2
    assert "only planners can be animated, and" in capsys.readouterr().err
    assert main(["plan", "paper:1", "--planner", str(model)]) == 2
    assert "is an agent, not a planner" in capsys.readouterr().err


@pytest.mark.slow
def test_workers_fly_the_same_flights(model: Path, tmp_path: Path) -> None:
    found = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        policies = ["--policy", str(model), "--policy", "guided"]
        where = ["--fields", FIELDS, "--out", str(out), "--workers", workers]
        assert main(["evaluate", *policies, *where]) == 0
        found.append((out / "flights.csv").read_bytes() + (out / "paths.npz").read_bytes())
    assert found[0] == found[1]
