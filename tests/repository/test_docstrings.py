"""Examples in docstrings do what they show."""

import doctest
import importlib

import pytest

from tests.support.places import ROOT

MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for package in ("ferguson_gym", "planners", "agents")
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]
"""Only those with examples are imported: some take long, or need what is not installed."""


@pytest.mark.parametrize("module", MODULES)
def test_examples_in_docstrings_run(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted
    assert not found.failed, capsys.readouterr().out


def test_main_functions_have_examples() -> None:
    assert {
        "ferguson_gym.curves.splines",
        "ferguson_gym.world.field_names",
        "planners.registry",
    } <= set(MODULES)
