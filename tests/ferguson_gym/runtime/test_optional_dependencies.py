"""Planners whose library is missing say what to install."""

import pytest

from ferguson_gym.runtime.optional_dependencies import require


def test_a_missing_library_is_named_with_the_extra() -> None:
    with pytest.raises(ValueError) as caught:
        require("mine", "no_such_module_anywhere", "No Such")
    assert (
        str(caught.value)
        == "planner 'mine' needs No Such: .venv/bin/pip install --editable '.[peers]'"
    )


def test_a_library_that_is_there_is_not_imported() -> None:
    require("mine", "antigravity", "Python")  # importing it would open a browser
