"""What the README and the pages of docs/ hold: blocks of code, and the commands in them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from tests.support.places import ROOT

README = ROOT / "README.md"
PAGES = sorted(
    page
    for page in (ROOT / "docs").rglob("*.md")
    if page.parent.name not in ("generated", "_build")
)
"""Pages that are written, not those that a build of the documentation generates."""
_BLOCK = re.compile(r"^```(\S*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_RANGE = re.compile(r"^(.+:)?([0-9]+)-([0-9]+)$")
_FEW = {"--minutes": "0.5", "--windows": "2", "--slow": "1", "--steps": "600"}
"""Options that say how much is done, and how little the tests do."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block of code in a page."""

    page: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path, language: str | None = None) -> list[Block]:
    """The blocks of a page in order, those of one language or all."""
    text = page.read_text(encoding="utf-8")
    found = [
        Block(page, text.count("\n", 0, match.start()) + 1, match[1], match[2])
        for match in _BLOCK.finditer(text)
    ]
    return [block for block in found if language in (None, block.language)]


def commands_of(block: Block) -> list[list[str]]:
    """The words of the commands in a block."""
    lines = block.text.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line.partition("  #")[0]))]


def reduced(words: list[str]) -> list[str]:
    """A command that does the same with less: two fields, seeds or windows, and in one process."""
    few: list[str] = []
    for before, word in zip(["", *words], words, strict=False):
        if before == "--workers":
            few.pop()
        elif before in _FEW:
            few.append(_FEW[before])
        elif match := _RANGE.match(word):
            first = int(match[2])
            few.append(f"{match[1] or ''}{first}-{min(first + 1, int(match[3]))}")
        else:
            few.append("2" if word.isdecimal() and int(word) > 2 else word)
    return few
