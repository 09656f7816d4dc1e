"""Tells the counts at the end of a large run, whichever process ran the cases."""

from typing import Any

import pytest
from hypothesis import settings

from tests.fuzz import cases

_SENT = "fuzz"


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[_SENT] = dict(cases.COUNTS), dict(cases.REFUSED)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    counts, refused = getattr(node, "workeroutput", {}).get(_SENT, ({}, {}))
    cases.COUNTS.update(counts)
    cases.REFUSED.update(refused)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if cases.COUNTS and settings().max_examples >= cases.LARGE:
        terminalreporter.section("fuzz")
        for line in cases.table():
            terminalreporter.write_line(line)
