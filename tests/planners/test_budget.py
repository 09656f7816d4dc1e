"""Budgets of anytime planners."""

import pytest

from planners.interface import Evaluations, Iterations, Seconds


@pytest.mark.parametrize(
    ("kind", "amount", "message"),
    [
        (Iterations, 0, "at least 1 iteration, got 0"),
        (Evaluations, -3, "at least 1 evaluation, got -3"),
        (Seconds, 0.0, "seconds above 0, got 0"),
        (Seconds, float("inf"), "seconds above 0, got inf"),
        (Seconds, float("nan"), "seconds above 0, got nan"),
    ],
)
def test_an_empty_or_endless_budget_is_refused(kind, amount, message):
    with pytest.raises(ValueError, match=message):
        kind(amount)


def test_budgets_are_told_apart_by_their_kind():
    assert Iterations(5) == Iterations(5) != Evaluations(5)
    assert Seconds(0.5).seconds == 0.5
