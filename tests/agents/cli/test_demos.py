"""`ferguson demos`: what is refused before anything is flown, whether or not Minari is there."""

import subprocess
import sys
from pathlib import Path

import pytest

from agents.cli.main import main
from agents.demonstrations import minari_store
from agents.demonstrations.minari_store import namespace_of
from agents.demonstrations.reading import read


def refused(arguments: dict[str, str], capsys: pytest.CaptureFixture[str]) -> str:
    given = {"--expert": "guided", "--fields": "sparse/train:0-1", "--out": "some-v0"} | arguments
    assert main(["demos", *(word for pair in given.items() for word in pair)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_without_minari_it_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(minari_store.importlib.util, "find_spec", lambda _: None)
    message = "demonstrations need Minari: .venv/bin/pip install --editable '.[demos]'"
    assert message in refused({}, capsys)
    with pytest.raises(ValueError) as caught:
        read("some-v0")
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"--expert": "nobody"}, "unknown policy 'nobody'"),
        ({"--expert": "guided+margin=-1"}, "a margin must be above 0 m and finite, got -1 m"),
        ({"--fields": "sparse/exam:0"}, "unknown split 'exam'"),
        ({"--rays": "0"}, "need an integer >= 1"),
        ({"--nearest": "10001"}, "need nearest from 1 to 10000, got 10001"),
        ({"--out": "some"}, "a dataset's id is NAME-vN or NAMESPACE/NAME-vN"),
        ({"--out": "../some-v0"}, "a dataset's id is NAME-vN or NAMESPACE/NAME-vN"),
    ],
)
def test_bad_input_is_named(
    arguments: dict[str, str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(minari_store, "_datasets_root", lambda: tmp_path / "datasets")
    monkeypatch.setattr(minari_store, "require_minari", lambda: None)
    assert message in refused(arguments, capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("dataset_id", "namespace"),
    [("some-v0", ""), ("ferguson/guided-v12", "ferguson"), ("a_1/b-2/c_d-e-v3", "a_1/b-2")],
)
def test_ids_begin_with_a_namespace_or_not(dataset_id: str, namespace: str) -> None:
    assert namespace_of(dataset_id) == namespace


def test_the_program_starts_without_optional_libraries() -> None:
    program = (
        "import sys, agents.cli.main, agents.demonstrations.reading\n"
        "print([m for m in ('minari', 'h5py', 'torch', 'stable_baselines3') if m in sys.modules])"
    )
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert said.stdout == "[]\n", said.stderr
