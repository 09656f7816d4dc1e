"""Agents by name: those that are shipped, and those that lie at a path."""

import importlib.util
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from agents.models import shipped_agents
from agents.models.model_card import ModelCard
from agents.policies.registry import make_policy
from agents.policies.spec import PolicySpec
from tests.support.places import ROOT


def agent(directory: Path) -> Path:
    directory.mkdir(parents=True)
    for name in ("model.zip", "model.json"):
        (directory / name).touch()
    return directory


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(shipped_agents, "SHIPPED", tmp_path / "shipped")
    monkeypatch.chdir(tmp_path)
    for name in ("ace", "rookie"):
        agent(tmp_path / "shipped" / name)
    (tmp_path / "shipped/__pycache__").mkdir()
    (tmp_path / "shipped/best.json").write_text(json.dumps({"best": "ace"}))
    return tmp_path / "shipped"


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda module: module)


@pytest.mark.usefixtures("installed")
def test_shipped_agents_have_names_and_best_is_one_of_them(shipped: Path) -> None:
    assert shipped_agents.shipped() == {
        "ace": shipped / "ace",
        "rookie": shipped / "rookie",
        "best": shipped / "ace",
    }
    assert shipped_agents.find_agent("best") == shipped_agents.find_agent("ace") == shipped / "ace"
    assert shipped_agents.find_agent("nobody") is None


def test_best_is_an_agent_with_its_options(shipped: Path) -> None:
    (shipped / "best.json").write_text(json.dumps({"best": "ace+tries=8"}))
    assert str(PolicySpec.parse("best")) == "ace+tries=8"
    assert str(PolicySpec.parse("best+shield")) == "ace+tries=8+shield"
    assert str(PolicySpec.parse("best+tries=3")) == "ace+tries=3"
    assert str(PolicySpec.parse("rookie+tries=3")) == "rookie+tries=3"
    assert shipped_agents.shipped()["best"] == shipped / "ace"


@pytest.mark.parametrize(
    "content", [b"", b"\xff", b"[]", b"3", b'{"best": null}', b'{"best": "best"}', b'{"ace": 1}']
)
def test_a_damaged_file_that_names_the_best_agent_is_reported(
    shipped: Path, content: bytes
) -> None:
    (shipped / "best.json").write_bytes(content)
    with pytest.raises(ValueError, match=r"best\.json is damaged: .* install again"):
        make_policy("best")


@pytest.mark.usefixtures("installed", "shipped")
def test_trained_agents_are_found_by_their_directory_or_a_file_in_it(tmp_path: Path) -> None:
    place = agent(tmp_path / "runs/ppo")
    for given in ("runs/ppo", "runs/ppo/", "runs/ppo/model.zip", str(place)):
        found = shipped_agents.find_agent(given)
        assert found is not None
        assert found.resolve() == place
    (place / "model.json").unlink()
    assert shipped_agents.find_agent("runs/ppo") is not None  # loading reports it
    for given in ("runs", "runs/nothing", "", "\x00", "x" * 5000):
        assert shipped_agents.find_agent(given) is None


def test_a_missing_library_is_reported(shipped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda module: module != "torch" or None)
    card = ModelCard(algorithm="tqc", policy="mlp", policy_kwargs={}, environment={})
    (shipped / "ace" / "model.json").write_text(card.to_json())
    zipfile.ZipFile(shipped / "ace" / "model.zip", "w").close()
    with pytest.raises(ValueError, match=r"'ace' needs torch: .*'\.\[agents\]'"):
        make_policy("best")


@pytest.mark.usefixtures("shipped")
def test_the_error_for_an_unknown_policy_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match="gcs, ace, rookie, best, and the directories of trained"):
        make_policy("bset")


def test_shipped_agents_have_both_files() -> None:
    for name, directory in shipped_agents.shipped().items():
        assert (directory / "model.zip").is_file(), name
        assert (directory / "model.json").is_file(), name


def test_neither_planners_nor_the_surface_of_models_import_torch() -> None:
    program = (
        "import sys; from agents.cli.main import _parser; import agents.evaluation.run; "
        "from agents.models import Model, ModelCard, load; "
        "from agents.policies.registry import make_policy; _parser(); make_policy('guided'); "
        "sys.exit(any(name in sys.modules for name in ('torch', 'stable_baselines3')))"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)
