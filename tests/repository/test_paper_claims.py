"""The paper's claims are tested by variants that differ, and every row of the table is honest."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.world.field_names import get_field
from planners.interface import initial_state


@pytest.fixture
def claims(benchmark: Callable[[str], Any]) -> Any:
    return benchmark("paper_claims")


def test_every_variant_flies_and_each_is_held_against_its_reference(claims: Any) -> None:
    # two dozen planners fly there: the goal is nearer than usual
    near = [replace(get_field(f"sparse/train:{k}"), goal=np.array([66.0, 66.0])) for k in range(2)]
    flights = [claims.fly(field, k, 2) for k, field in enumerate(near)]
    # those by SLSQP fly a tenth of the fields, and the first of them in any case
    assert set(flights[0]) == set(claims.variants())
    assert {name for name in flights[0] if "SLSQP" in name} == set(flights[0]) - set(flights[1])
    lengths = {name: flown.length for name, flown in flights[0].items()}
    assert len(set(lengths.values())) > len(lengths) / 2  # they fly differently
    table = claims.rows(flights)
    assert len(table) == sum(len(group) for group in claims.GROUPS.values())
    for row in table:
        assert 0.0 <= row.success_interval.low <= row.success <= row.success_interval.high <= 1.0
        if row.variant == claims.REFERENCE:
            assert row.longer == 0.0
            assert row.slower == row.costlier == 1.0
            assert row.mcnemar == 1.0
    text = claims.markdown(table)
    assert all(name in text for name in claims.variants())


def test_a_failure_counts_in_success_and_spl_and_is_compared_in_neither_length_nor_time(
    claims: Any,
) -> None:
    here = {"seconds": 1.0, "windows": 10, "evaluations": 5.0, "reach": 40.0, "winding": 1.0}
    good = claims.Flown(success=True, length=150.0, spl=0.9, **here)
    long = claims.Flown(success=True, length=165.0, spl=0.8, **(here | {"seconds": 4.0}))
    bad = claims.Flown(success=False, length=20.0, spl=0.0, **(here | {"seconds": 99.0}))
    row = claims._row("group", "variant", [(long, good), (bad, good), (good, bad)])
    assert row.success == pytest.approx(2 / 3)
    assert row.spl == pytest.approx((0.8 + 0.0 + 0.9) / 3)
    assert row.longer == pytest.approx(0.1)
    assert row.costlier == pytest.approx(4.0)
    assert row.slower == pytest.approx((4.0 * 99.0 / 99.0) ** (1 / 3))


def test_a_random_guess_alone_never_flies_what_the_shifted_plan_leads_to(claims: Any) -> None:
    field = get_field("standard/train:0")
    plan = claims.variants()["random"].planner.plan(field, initial_state(field), 0)
    used = {decision.report.start for decision in plan.decisions if decision.chain is not None}
    assert used <= {"random 1", "planned"}
    assert "random 1" in used


@pytest.mark.parametrize("name", ["7.5 m", "20 m", "30 m"])
def test_segments_are_as_long_as_the_variant_says(claims: Any, name: str) -> None:
    variant = claims.variants()[name]
    field = replace(get_field("sparse/train:0"), limits=variant.limits)
    plan = variant.planner.plan(field, initial_state(field), 0)
    assert plan.success
    assert length(plan.control).max() == pytest.approx(float(name.removesuffix(" m")), abs=2e-5)
