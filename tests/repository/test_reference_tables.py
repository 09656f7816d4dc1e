"""docs/results.md holds the tables of what evaluations came to, and nothing that was typed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agents.policies.knowledge import label_by_name
from tests.support.places import ROOT


@pytest.fixture
def tables(benchmark: Callable[[str], Any]) -> Any:
    return benchmark("reference_tables")


def test_the_page_holds_the_tables_of_what_is_kept(tables: Any) -> None:
    page = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    assert tables.shown().strip() in page


def test_every_evaluation_is_on_the_test_split_and_says_its_command(tables: Any) -> None:
    kept = [json.loads(path.read_text()) for path in tables.KEPT.glob("*.json")]
    evaluations = [one for one in kept if "family" in one]
    assert len(evaluations) >= 4
    for one in evaluations:
        assert one["family"].endswith("/test")
        assert all(f"--fields {name}" in one["command"] for name in one["fields"])
        for row in one["policies"]:
            assert row["knows"] == label_by_name(row["policy"])
            assert f"--policy {row['policy']}" in one["command"]
            assert row["flights"] == sum(row["outcomes"].values())
            assert row["successes"] == row["outcomes"].get("goal_reached", 0)
            assert row["success"] == row["successes"] / row["flights"]


def test_failures_show_as_failures(tables: Any) -> None:
    row = {
        "policy": "one",
        "fields": 1000,
        "success": 0.9996,
        "success_low": 0.2,
        "success_high": 1.0,
        "spl": 0.5,
        "spl_low": 0.4,
        "spl_high": 0.6,
        "gap_median": 0.0123,
        "gap_99": None,
    }
    text = tables._table([row], {"one": {"flight_seconds_median": 0.0123}})
    # never rounded up to all
    assert text.splitlines()[-1] == (
        "| `one` | 1,000 | 99.9+ % (20.0 to 100) | 0.500 (0.400 to 0.600) | 1.23 % | failed "
        "| 12 ms |"
    )


def test_each_table_has_two_groups_also_of_older_excerpts(tables: Any) -> None:
    row = {"fields": 1, "success": 1.0, "success_low": 0.9, "success_high": 1.0}
    row |= {"spl_low": 0.4, "spl_high": 0.6, "gap_median": 0.1, "gap_99": None}
    ranked = [("multi-start", 0.9), ("guided", 0.5), ("runs/mine", 0.3), ("runs/other", 0.95)]
    rows = [{"policy": name, "spl": spl, **row} for name, spl in ranked]
    rows[2]["knows"] = "whole field"
    shown = tables._table(rows, {}).splitlines()[2:]
    assert [line.split("|")[1].strip() for line in shown] == [
        "**whole field**",
        "`guided`",
        "`runs/mine`",
        "**nearby**",
        "`multi-start`",
        "**?**",
        "`runs/other`",
    ]
    assert {line.count("|") for line in shown} == {8}


def test_results_of_several_suites_are_refused(tables: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no results"):
        tables.kept(tmp_path)
    summary = {
        "command": "ferguson evaluate",
        "configuration": {"fields": ["paper:1-4", "dense/test:0-9"], "commit": "", "versions": {}},
        "statistics": {"policies": []},
    }
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(ValueError, match="need one suite"):
        tables.kept(tmp_path)
