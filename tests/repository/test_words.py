"""The language of the project: phrases that a reader must read twice are found, pins agree.

Spelling is checked by codespell, in `make check`.
"""

import re
import subprocess
from pathlib import Path

import pytest
import yaml

from tests.support.places import ROOT

PHRASES = {
    r"\b(?:is|are|was|were|be|been|being) told\b(?! apart)": "say what is reported, shown or named",
    r"\banew\b": "again, or a verb such as redraw and recompute",
    r"\b[Ww]ho(?:m)?ever\b": "name the caller, the user or the process",
    r"\b(?:leads?|led) to nothing\b": "fails, or finds no feasible chain",
    r"\bas ever\b": "like every other, or leave it out",
    r"\bin vain\b": "without success",
    r"(?<!there )\bis none\b": "is not one, or is missing",
    r"\b[Dd]oubtful\b": "that fails a check, or inconclusive",
    r"\brefused with one sentence\b": "raises a ValueError, or stops with an error",
}
"""Phrases to avoid, and what to write instead."""
ENDINGS = (".py", ".md", ".yml", ".html")
_SPACE = re.compile(r"[ \t]*\n[ \t#>-]*")


def written() -> list[Path]:
    """Tracked files of prose and code, without this one."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z"]
    names = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\0")
    return [ROOT / name for name in names if name.endswith(ENDINGS) and name != _THIS]


_THIS = Path(__file__).relative_to(ROOT).as_posix()


def found(text: str) -> list[str]:
    """Each phrase in a text, also across lines, and what to write instead."""
    flat = _SPACE.sub(" ", text)
    return [
        f"{flat[max(0, match.start() - 40) : match.end() + 20]!r}: {instead}"
        for phrase, instead in PHRASES.items()
        for match in re.finditer(phrase, flat)
    ]


def test_phrases_are_found_across_lines() -> None:
    assert found("What\n    # is told\n    # of it")
    assert found("Whoever asks")
    assert not found("x is None; who ever told it was untold")


@pytest.mark.parametrize("path", written(), ids=lambda path: str(path.relative_to(ROOT)))
def test_no_phrase_must_be_read_twice(path: Path) -> None:
    assert not found(path.read_text(encoding="utf-8"))


def test_hooks_use_the_versions_that_the_project_is_checked_with() -> None:
    pins = set((ROOT / "constraints.txt").read_text().split())
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    assert {need for hook in hooks for need in hook["additional_dependencies"]} <= pins
