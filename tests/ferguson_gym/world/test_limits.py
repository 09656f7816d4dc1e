"""Limits belong to a field: their defaults, their ratios and how they change."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ferguson_gym.world import PAPER_LIMITS, Field, Limits, Obstacles, get_field
from ferguson_gym.world.field import to_json

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


def far(distance: float, **options: object) -> Field:
    return Field(
        name="far",
        obstacles=Obstacles.discs([], []),
        goal=[distance, 0.0],
        bounds=(-10.0, distance + 10.0),
        **options,
    )


def test_fields_have_the_papers_limits_by_default() -> None:
    assert OPEN.limits == get_field("standard/test:3").limits == PAPER_LIMITS


def test_what_is_not_given_keeps_its_ratio_to_the_longest_segment() -> None:
    limits = Limits(longest=150.0, gate=2.0)
    assert (limits.shortest, limits.gate) == (30.0, 2.0)
    assert limits.slowest == pytest.approx(1.0)
    assert limits.tolerance == pytest.approx(1e-4)
    assert limits.unit == 10.0


@pytest.mark.parametrize(
    ("distance", "longest", "segments"),
    [(100.0, 15.0, 40), (441.0, 15.0, 125), (2000.0, 15.0, 567), (2000.0, 150.0, 57)],
)
def test_segments_fly_four_and_a_quarter_times_the_distance(
    distance: float, longest: float, segments: int
) -> None:
    assert far(distance, limits={"longest": longest}).limits.segments == segments


def test_segments_that_are_given_stay() -> None:
    assert far(2000.0, limits={"segments": 7}).limits.segments == 7


def test_the_default_start_derivative_is_a_third_of_the_longest_segment() -> None:
    np.testing.assert_array_equal(far(100.0, limits={"longest": 30.0}).departure, [10.0, 0.0])
    np.testing.assert_array_equal(far(100.0, limits={"slowest": 6.0}).departure, [6.0, 0.0])


def test_another_longest_segment_scales_the_field_with_it() -> None:
    field = OPEN.with_limits(gate=2.0).with_limits(longest=30.0)
    assert (field.limits.shortest, field.limits.gate, field.limits.longest) == (6.0, 4.0, 30.0)
    assert np.linalg.norm(field.departure) == pytest.approx(10.0)
    assert OPEN.with_limits() is OPEN
    kept = Field(name="own", obstacles=Obstacles.discs([], []), start_derivative=[7.0, 0.0])
    np.testing.assert_array_equal(kept.with_limits(longest=30.0).departure, [7.0, 0.0])


def test_a_default_number_of_segments_stays_the_default() -> None:
    assert far(2000.0).with_limits(longest=150.0).limits.segments == 57
    assert far(2000.0, limits={"segments": 99}).with_limits(longest=150.0).limits.segments == 99


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"longets": 20.0}, r"unknown limit 'longets' \(did you mean 'longest'\?\)"),
        ({"longest": "20"}, "limit longest must be a number, got '20'"),
        ({"longest": 2.0, "shortest": 3.0}, "need 0 < shortest < longest"),
        (15.0, "limits are names with values, for example .*, got 15.0"),
        ([1, 2], r"limits are names with values, .*, got \[1, 2\]"),
    ],
)
def test_bad_limits_are_refused(limits: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        far(100.0, limits=limits)


def test_limits_of_a_file_are_read_and_written(tmp_path: Path) -> None:
    file = tmp_path / "big.json"
    data = {"centers": [], "radii": [], "goal": [900, 0], "bounds": [-50, 950]}
    file.write_text(json.dumps({**data, "limits": {"longest": 150, "gate": None}}))
    field = get_field(str(file))
    assert (field.limits.longest, field.limits.gate, field.limits.segments) == (150, 10.0, 40)
    to_json(field, tmp_path / "again.json")
    again = get_field(str(tmp_path / "again.json"))
    assert again.limits == field.limits
    np.testing.assert_array_equal(again.departure, field.departure)
    to_json(OPEN, tmp_path / "open.json")
    assert "limits" not in json.loads((tmp_path / "open.json").read_text())
