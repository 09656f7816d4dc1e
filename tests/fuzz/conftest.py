"""Tells the counts at the end of a large run."""

import pytest
from hypothesis import settings

from tests.fuzz import cases


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if cases.COUNTS and settings().max_examples >= cases.LARGE:
        terminalreporter.section("fuzz")
        for line in cases.table():
            terminalreporter.write_line(line)
