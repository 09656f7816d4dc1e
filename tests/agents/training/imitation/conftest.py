"""Fixtures of imitation: a command line and demonstrations."""

from pathlib import Path

import pytest

from tests.support.tiny_imitation import Command, Flights, command_in


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """The command line of a tiny training in tmp_path/out."""
    return command_in(tmp_path)


@pytest.fixture
def demos(monkeypatch: pytest.MonkeyPatch) -> Flights:
    """Make the datasets some/pursuit-v0, of four flights, and some/none-v0 readable."""
    from agents.demonstrations import reading

    flights = Flights(4)
    kept = {"some/pursuit-v0": flights, "some/none-v0": Flights(0)}
    monkeypatch.setattr(reading, "read", kept.__getitem__)
    return flights
