"""Planners whose library is missing say what to install."""

import pytest

from ferguson_gym.runtime import optional_dependencies
from ferguson_gym.runtime.jit import PACKAGES
from ferguson_gym.runtime.optional_dependencies import require
from tests.support.places import ROOT


def test_a_missing_library_is_named_with_the_extra() -> None:
    with pytest.raises(ValueError) as caught:
        require("mine", "no_such_module_anywhere", "No Such")
    assert (
        str(caught.value)
        == "planner 'mine' needs No Such: .venv/bin/pip install --editable '.[peers]'"
    )


def test_a_library_that_is_there_is_not_imported() -> None:
    require("mine", "antigravity", "Python")  # importing it would open a browser


def test_outside_a_checkout_the_hint_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    place = "/usr/lib/python3/site-packages/ferguson_gym/runtime/optional_dependencies.py"
    monkeypatch.setattr(optional_dependencies, "__file__", place)
    assert optional_dependencies.installing("agents") == "pip install 'ferguson-gym[agents]'"


def test_only_one_place_tells_how_to_install() -> None:
    """Others would name a checkout in an installed wheel."""
    places = [
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if "pip install" in path.read_text()
    ]
    assert places == ["ferguson_gym/runtime/optional_dependencies.py"]
