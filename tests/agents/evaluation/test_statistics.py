"""Statistics of evaluations: against closed forms, brute force and hand-made results."""

import csv
import io
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table
from scipy.stats import trim_mean

from agents.evaluation import bootstrap, tables
from agents.evaluation.bootstrap import percentiles, resampled_means, resampled_quartile_means
from agents.evaluation.reading import read
from agents.evaluation.results import TIMING_COLUMNS
from agents.evaluation.statistics import (
    caution,
    holm,
    improvement,
    interquartile_mean,
    mcnemar,
    success_wins,
    summarise,
    summary,
)
from agents.flights.flight_table import FlightTable
from tests.support.written_results import EXACT, write_results


def random_results(directory: Path, seeds: int = 1, fields: int = 30) -> FlightTable:
    """Three policies; the first never fails, the last often."""
    rng = np.random.default_rng(3)
    lengths = {
        policy: {
            f"f{k}": [
                None if rng.random() < chance else EXACT * (1.0 + rng.exponential(0.1))
                for _ in range(seeds)
            ]
            for k in range(fields)
        }
        for policy, chance in (("sure", 0.0), ("fair", 0.1), ("poor", 0.6))
    }
    return read(write_results(directory, lengths))


def test_mcnemars_test_adds_up_the_tails_of_a_fair_coin() -> None:
    assert mcnemar(0, 0) == 1.0
    assert mcnemar(5, 0) == pytest.approx(2 * 0.5**5)
    both_tails = 2 * sum(math.comb(12, k) for k in range(4)) / 2**12
    assert mcnemar(3, 9) == mcnemar(9, 3) == pytest.approx(both_tails)


def test_holm_raises_the_least_chance_most_and_keeps_the_order() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def test_a_comparison_on_few_fields_warns_its_readers() -> None:
    two = [{}, {}]
    assert "so few fields (19)" in str(caution({"fields": 19, "policies": two}))
    assert caution({"fields": 20, "policies": two}) is None
    assert caution({"fields": 1, "policies": two[:1]}) is None  # compares nothing


def test_flights_without_a_shortest_path_are_told() -> None:
    known, unknown = {"flights": 4, "gap_flights": 4}, {"flights": 4, "gap_flights": 3}
    assert not list(tables.without_gap({"policies": [known, known]}))
    (told,) = tables.without_gap({"policies": [unknown, unknown]})
    assert told.startswith("no shortest path to compare with for 2 flights: ")


def test_in_a_comparison_a_failure_loses_and_ties_count_half() -> None:
    lost, unknown = math.inf, math.nan
    first = np.array([150.0, 150.0, 150.0, 150.0, lost, lost, unknown])
    second = np.array([160.0, 140.0, 150.0 + 1e-6, lost, 150.0, lost, 150.0])
    np.testing.assert_array_equal(
        improvement(first, second), [1.0, 0.0, 0.5, 1.0, 0.0, 0.5, math.nan]
    )


def test_fields_are_won_by_more_successes_on_seeds_that_both_flew() -> None:
    lost, unknown = math.inf, math.nan
    first = np.array([[1.0, 1.0], [lost, 1.0], [lost, lost], [1.0, lost]])
    second = np.array([[1.0, lost], [1.0, lost], [1.0, lost], [unknown, lost]])
    assert success_wins(first, second) == (1, 1)


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 8, 30])
def test_the_interquartile_mean_leaves_out_a_quarter_at_both_ends(number: int) -> None:
    values = np.random.default_rng(number).random(number)
    cut = number // 4
    expected = np.sort(values)[cut : number - cut].mean()
    assert interquartile_mean(values) == pytest.approx(expected)
    values[: number // 4] = math.inf  # failures among the worst quarter
    assert math.isfinite(interquartile_mean(values) or 0.0)
    assert interquartile_mean([]) is None


@pytest.mark.parametrize("seeds", [1, 3])
def test_resampled_statistics_are_those_of_repeated_flights(
    seeds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bootstrap, "RESAMPLES", 20)
    rng = np.random.default_rng(0)
    values = rng.random((2, 13, seeds))
    values[1, 3:6] = math.inf
    values[1, 7, 0] = math.nan
    draws = [
        (by_field, by_seed)
        for portion in bootstrap.draws(13, seeds, 5)
        for by_field, by_seed in zip(*portion, strict=True)
    ]
    assert len(draws) == 20
    means = resampled_means(np.where(np.isinf(values), 0.0, values), 5)
    quartile_means = resampled_quartile_means(values[1], 5)
    for k, (by_field, by_seed) in enumerate(draws):
        assert by_field.sum() == 13
        assert by_seed.sum() == seeds
        again = np.repeat(np.repeat(values, by_field, axis=1), by_seed, axis=2)
        known = again[1][~np.isnan(again[1])]
        assert quartile_means[k] == pytest.approx(trim_mean(known, 0.25))
        finite = np.where(np.isinf(again), 0.0, again)
        np.testing.assert_allclose(means[k], np.nanmean(finite, axis=(1, 2)))


def test_draws_in_small_portions_cover_the_same_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bootstrap, "_AT_ONCE", 64)
    values = np.random.default_rng(0).random((3, 50, 1))
    assert resampled_means(values, 0).shape == (bootstrap.RESAMPLES, 3)


def test_the_bootstrap_of_a_mean_is_as_wide_as_theory_says() -> None:
    values = np.random.default_rng(1).random((1, 400, 1))
    interval = percentiles(resampled_means(values, 0)[:, 0], 400)
    assert interval is not None
    half = 1.96 * values.std() / 20.0
    np.testing.assert_allclose(interval, values.mean() + np.array([-half, half]), atol=0.1 * half)


def test_seeds_that_change_nothing_do_not_narrow_an_interval() -> None:
    one = np.random.default_rng(1).random((1, 40, 1))
    often = np.repeat(one, 20, axis=2)
    widths = [
        np.subtract(*(percentiles(resampled_means(v, 0)[:, 0], 40) or (0, 0))) for v in (one, often)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.1)


def test_one_field_has_no_interval() -> None:
    assert percentiles(resampled_means(np.ones((1, 1, 5)), 0)[:, 0], 1) is None


@pytest.mark.parametrize("seeds", [1, 3])
def test_a_summary_agrees_with_counting_by_hand(tmp_path: Path, seeds: int) -> None:
    flights = random_results(tmp_path, seeds)
    found = summary(flights)
    by_name = {one["policy"]: one for one in found["policies"]}
    assert list(by_name) == ["sure", "fair", "poor"]
    lengths = flights.grid(np.where(flights.success, flights["length"], math.inf))
    for k, name in enumerate(by_name):
        one, flown = by_name[name], lengths[k].ravel()
        arrived = np.isfinite(flown)
        assert one["flights"] == flown.size == 30 * seeds
        assert one["success"] == arrived.mean()
        assert one["outcomes"].get("collision", 0) == (~arrived).sum()
        assert one["spl"] == pytest.approx((EXACT / np.maximum(flown, EXACT)).mean())
        assert one["spl_low"] < one["spl"] < one["spl_high"]
        assert one["success_low"] <= one["success"] <= one["success_high"]
        gaps = np.sort(flown / EXACT - 1.0)
        for key, share in (("gap_median", 0.5), ("gap_90", 0.9), ("gap_99", 0.99)):
            expected = gaps[math.ceil(share * gaps.size) - 1]
            assert one[key] == (pytest.approx(expected) if np.isfinite(expected) else None)
    assert by_name["sure"]["gap_iqm_low"] < by_name["sure"]["gap_iqm"]
    assert by_name["sure"]["gap_iqm"] < by_name["sure"]["gap_iqm_high"]
    assert by_name["poor"]["gap_median"] is None
    assert by_name["poor"]["gap_iqm"] is None
    pairs = {(one["first"], one["second"]): one for one in found["pairs"]}
    assert list(pairs) == list(itertools.combinations(by_name, 2))
    for (first, second), one in pairs.items():
        a, b = (lengths[list(by_name).index(name)] for name in (first, second))
        ahead = np.isfinite(a).sum(1) - np.isfinite(b).sum(1)
        assert (one["first_wins"], one["second_wins"]) == ((ahead > 0).sum(), (ahead < 0).sum())
        assert one["mcnemar_p"] == mcnemar(one["first_wins"], one["second_wins"])
        assert one["mcnemar_p"] <= one["mcnemar_p_holm"] <= 1.0
        better = [
            0.5 if x == y else float(x < y) for x, y in zip(a.ravel(), b.ravel(), strict=True)
        ]
        assert one["improvement"] == pytest.approx(np.mean(better))
        difference = by_name[first]["spl"] - by_name[second]["spl"]
        assert one["spl_difference"] == pytest.approx(difference)
        assert one["spl_difference_low"] < difference < one["spl_difference_high"]
    for name, shares in found["profiles"]["shares"].items():
        assert shares == sorted(shares)
        assert shares[-1] == pytest.approx(by_name[name]["success"], abs=1e-6)


def test_the_same_results_and_seed_give_the_same_summary(tmp_path: Path) -> None:
    flights = random_results(tmp_path)
    again = summarise(tmp_path)
    assert json.dumps(summary(flights), allow_nan=False) == json.dumps(again, allow_nan=False)
    other = summarise(tmp_path, seed=1)
    assert other["policies"][1]["spl"] == again["policies"][1]["spl"]
    assert other["policies"][1]["spl_low"] != again["policies"][1]["spl_low"]


def test_fields_without_a_shortest_path_have_no_gap_but_count_in_success(tmp_path: Path) -> None:
    write_results(
        tmp_path,
        {"a": {"open": [150.0], "closed": [None], "unknown": [160.0]}},
        {"open": EXACT, "closed": None, "unknown": None},
    )
    (one,) = summarise(tmp_path)["policies"]
    assert one["success"] == 2 / 3
    assert one["spl"] == pytest.approx(EXACT / 150.0 / 3)
    assert one["gap_flights"] == 1
    assert one["gap_99"] == one["gap_iqm"] == pytest.approx(150.0 / EXACT - 1.0)


def test_policies_that_share_no_fields_are_not_compared(tmp_path: Path) -> None:
    write_results(
        tmp_path,
        {
            "a": {"x": [150.0], "y": [150.0]},
            "b": {"y": [None], "z": [150.0]},
            "c": {"z": [150.0]},
        },
    )
    found = summarise(tmp_path)
    assert [one["flights"] for one in found["policies"]] == [2, 2, 1]
    assert found["policies"][1]["spl"] == pytest.approx(0.5 * EXACT / 150.0)
    pairs = {(one["first"], one["second"]): one["flights"] for one in found["pairs"]}
    assert pairs == {("a", "b"): 1, ("b", "c"): 1}
    assert found["pairs"][0]["spl_difference"] == pytest.approx(EXACT / 150.0)


def test_no_flights_at_all_make_an_empty_summary(tmp_path: Path) -> None:
    found = summarise(write_results(tmp_path, {}))
    assert found["flights"] == 0
    assert found["policies"] == found["pairs"] == []


def test_times_come_from_their_own_file_in_any_order(tmp_path: Path) -> None:
    write_results(tmp_path, {"a": {"x": [150.0], "y": [None], "z": [150.0]}})
    with (tmp_path / "timings.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(TIMING_COLUMNS)
        rows.writerows([("a", "z", 0, 0.3, 0.5, 3.0), ("a", "x", 0, 0.1, 0.9, 1.0)])
        rows.writerow(("a", "y", 0, 0.2, 0.7, 2.0))
    (one,) = summarise(tmp_path)["policies"]
    assert one["decision_seconds_median"] == 0.2
    assert one["slowest_decision_seconds_99"] == 0.9
    assert (one["flight_seconds_median"], one["flight_seconds_99"]) == (2.0, 3.0)


def test_bad_results_are_refused_with_file_and_line(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no flights\.csv in"):
        read(tmp_path)
    path = write_results(tmp_path, {"a": {"x": [150.0]}}) / "flights.csv"
    good = path.read_text()
    for text, told in (
        (good + good.splitlines()[1], r"line 3: the flight a x 0 occurs twice"),
        (good.replace("150.0", "far"), r"line 2: could not convert string to float: 'far'"),
        (good.replace("gap", "gape"), r"has no column gap"),
        (good.replace(",4.0", ""), r"line 2: not as many cells as columns"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=told):
            read(tmp_path)


def test_the_terminal_shows_intervals_and_the_best_against_all(tmp_path: Path) -> None:
    write_results(
        tmp_path,
        {
            "[red]late": {f"f{k}": [None if k % 2 else 160.0] for k in range(20)},
            "good": {f"f{k}": [140.0 + k] for k in range(20)},
        },
    )
    found = summarise(tmp_path)
    console = Console(width=120, record=True, file=io.StringIO())
    knows = {one["policy"]: one["knows"] for one in found["policies"]}
    console.print(tables.policies(found, knows))
    console.print(tables.against_the_best(found, knows))
    text = console.export_text().replace("\N{EN DASH}", "-")
    lines = [line.strip() for line in text.splitlines()]
    shown = [line for line in lines if line.startswith(("good ", "[red]late"))]
    assert [line.split()[0] for line in shown] == ["good", "[red]late", "good", "[red]late"]
    assert "100.0 (83.9-100.0)" in shown[0]
    assert "50.0 (29.9-70.1)" in shown[1]
    assert "inf" in shown[1]
    late, good = (one["spl"] for one in found["policies"])
    assert f"{good - late:+.3f} (+0." in shown[3]
    assert "10 : 0" in shown[3]
    assert "100.0 (100.0-100.0)" in shown[3]
    write_results(tmp_path, {"alone": {"f": [150.0]}})
    assert tables.against_the_best(summarise(tmp_path), {}) is None


def test_tables_show_what_a_summary_records_and_derive_what_it_does_not(tmp_path: Path) -> None:
    lengths = {name: {"x": [150.0], "y": [151.0]} for name in ("runs/mine", "guided", "runs/old")}
    found = summarise(write_results(tmp_path, lengths))
    mine, guided, _ = found["policies"]
    mine["knows"] = "nearby"
    del guided["knows"]  # as in the summary of an older evaluation
    first, *_ = tables.of_summary({"statistics": found, "policies": []})
    assert isinstance(first, Table)
    names = [str(cell) for cell in first.columns[0].cells]
    assert names == ["whole field:", "guided", "nearby:", "runs/mine", "?:", "runs/old"]
