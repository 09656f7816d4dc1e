"""Documents say what each policy knows in every table that compares policies."""

import re
from pathlib import Path

import pytest

from agents.policies.knowledge import LABELS, label_by_name
from tests.support.documents import PAGES, README

_MEASURED = re.compile(r"\d ?(?:%|ms|s|times)|\d/\d")
_HEADING = re.compile(r"\*\*(.+)\*\*")


def rows(table: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]


def compared(page: Path) -> list[list[list[str]]]:
    """The tables of a page whose rows are measured policies."""
    text = page.read_text(encoding="utf-8")
    tables = [rows(found) for found in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)]
    return [
        table
        for table in tables
        if table[0][0] in ("policy", "planner")
        and any(_MEASURED.search(cell) for row in table[2:] for cell in row[1:])
    ]


COMPARING = list(filter(compared, [README, *PAGES]))


def test_such_tables_are_found() -> None:
    number = {page.name: len(compared(page)) for page in COMPARING}
    assert number == {"README.md": 1, "agents.md": 2, "planners.md": 2, "results.md": 6}


@pytest.mark.parametrize("page", COMPARING, ids=lambda page: page.name)
def test_each_policy_stands_below_what_it_knows(page: Path) -> None:
    for _, _, *body in compared(page):
        heading, seen = None, []
        for row in body:
            if found := _HEADING.fullmatch(row[0]):
                heading = found[1]
                seen.append(heading)
                continue
            name = re.match(r"`(.+?)`", row[0])
            assert name is not None, row
            assert label_by_name(name[1]) == heading, row[0]
        assert seen == list(LABELS)
