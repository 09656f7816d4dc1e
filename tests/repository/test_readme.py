"""The README does what it says: its Python runs, and so do its commands."""

import re
from pathlib import Path

import pytest

from agents.cli.main import main
from tests.support.documents import README, ROOT, Block, blocks, commands_of, reduced

TEXT = README.read_text(encoding="utf-8")


@pytest.mark.parametrize("block", blocks(README, "python"), ids=str)
def test_python_runs(block: Block, capsys: pytest.CaptureFixture[str]) -> None:
    if "stable_baselines3" in block.text:
        pytest.importorskip("stable_baselines3")
    text = block.text.replace("500_000", "1").replace("n_epochs=8", "n_epochs=1")
    exec(compile(text, str(block), "exec"), {})
    assert capsys.readouterr().out


def commands() -> list[list[str]]:
    return [words for block in blocks(README, "sh") for words in commands_of(block)]


def trained_for(command: list[str]) -> bool:
    """Whether a command trains, or flies what others have trained."""
    return any(word.startswith("runs/") for word in command)


LONG = {"0-29", "200", "standard/validation:0-99", "standard/train:0-999"}


def is_long(command: list[str]) -> bool:
    return not LONG.isdisjoint(command)


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(words, marks=[pytest.mark.slow] if is_long(words) else [])
        for words in commands()
        if not trained_for(words)
        and words[0] not in ("make", "git", ".venv/bin/pip")  # make installs what pip would
    ],
)
def test_commands_run(command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert command[0] == ".venv/bin/ferguson"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    assert main(command[1:]) == 0
    assert [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.slow
def test_trainings_run_one_after_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for words in filter(trained_for, commands()):
        if words[1] != "train":
            assert main(reduced(words[1:])) == 0
            continue
        minutes = words.index("--minutes") + 1  # the whole of it was run for the README
        assert main([*words[1:minutes], "0.1", *words[minutes + 1 :]]) == 0
        assert (tmp_path / words[words.index("--out") + 1] / "model.zip").is_file()


def test_make_targets_and_linked_files_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = [words[1] for words in commands() if words[0] == "make"]
    assert targets == ["run", "test"]
    for target in targets:
        assert f"\n{target}:" in makefile
    for link in re.findall(r"\]\((?!http)([^)#]+)\)", TEXT):
        assert (ROOT / link).exists(), link
