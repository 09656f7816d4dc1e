"""Planners of others by name: registered in a process, or by the entry point of a package."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint
from typing import Any
from unittest.mock import patch

import pytest

from planners import PLANNERS, make, register, registry
from planners.receding_horizon import Pursuit
from planners.wrappers import Sensing


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    with patch.dict(PLANNERS):
        yield


class Mine(Pursuit):
    """A planner of a test."""


def test_a_registered_planner_has_a_name_and_takes_options() -> None:
    register("mine", Mine)
    register("mine", Mine)  # again, as a module that is imported twice does
    assert isinstance(make("mine"), Mine)
    sensing = make("mine+sensing=20")
    assert isinstance(sensing, Sensing)
    assert isinstance(sensing.planner, Mine)
    assert registry.registered() == {"mine": Mine}


@pytest.mark.parametrize(
    ("name", "constructor", "message"),
    [
        ("guided", Mine, "there is a planner 'guided' already; choose another name"),
        ("mine+fast", Mine, "letters, digits, '.', '_' and '-' only, got 'mine.fast'"),
        ("", Mine, "only, got ''"),
        ("mine", 7, "planner 'mine' needs a class or a function that makes it, got 7"),
    ],
)
def test_wrong_registrations_are_refused(name: str, constructor: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        register(name, constructor)
    assert not registry.registered()


def test_a_taken_name_is_refused() -> None:
    register("mine", Mine)
    with pytest.raises(ValueError, match="there is a planner 'mine' already"):
        register("mine", Pursuit)


def test_what_a_constructor_makes_must_plan() -> None:
    register("mine", dict)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"'mine' is a dict without the method plan\(field, state"):
        make("mine")


def install(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """Load the registry's entry points as if a package with this one were installed."""
    entry = EntryPoint(name, value, registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [entry])
    registry._register_installed()


def test_an_entry_point_names_a_planner(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "theirs", "planners.receding_horizon:Pursuit")
    assert isinstance(make("theirs"), Pursuit)
    assert not registry.registered()  # every process finds it on its own


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (
            "nowhere.at.all:Planner",
            "'theirs' cannot be imported from nowhere.at.all:Planner: No mod",
        ),
        ("planners.receding_horizon:Nobody", "has no attribute 'Nobody'"),
        ("planners.registry:GROUP", "planners.registry:GROUP is not a class or a function"),
    ],
)
def test_a_broken_entry_point_is_an_error_when_its_planner_is_made(
    monkeypatch: pytest.MonkeyPatch, value: str, message: str
) -> None:
    install(monkeypatch, "theirs", value)
    with pytest.raises(ValueError, match=message):
        make("theirs")


def test_an_entry_point_with_a_taken_name_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.warns(UserWarning, match=r"entry point of a\.b:C: there is a planner 'guided' alr"):
        install(monkeypatch, "guided", "a.b:C")
    assert make("guided") is not None
