"""The report: what it holds, and that names cannot break it."""

import json
import re
import shutil
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.evaluation.report import page as report
from agents.evaluation.report.page import page, write_report
from agents.evaluation.report.svg import draw_chain, draw_obstacles, draw_shortest
from agents.plots.policy_comparison import COLOURS
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from tests.support.written_results import HOSTILE, STRANGE, chain, write_results, write_three


def held(directory: Path) -> dict[str, Any]:
    """The data in a report, as a browser would find it."""
    scripts: list[tuple[dict[str, str | None], str]] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
            if tag == "script":
                scripts.append((dict(attributes), ""))

        def handle_data(self, text: str) -> None:
            if scripts and self.cdata_elem == "script":
                scripts[-1] = (scripts[-1][0], scripts[-1][1] + text)

    Reader().feed((directory / "report.html").read_text(encoding="utf-8"))
    assert [script[0].get("type") for script in scripts] == ["application/json", None]
    data: dict[str, Any] = json.loads(scripts[0][1])
    return data


@pytest.fixture
def three(tmp_path: Path) -> Path:
    return write_three(tmp_path / "three")


def test_a_report_is_one_file_that_asks_nothing_of_a_network(three: Path) -> None:
    write_report(three)
    text = (three / "report.html").read_text(encoding="utf-8")
    addresses = set(re.findall(r"https?://[^\"'\s]+", text))
    assert addresses == {"http://www.w3.org/2000/svg"}  # a name, never fetched
    assert not re.search(r"<link|\ssrc=[\"']|@import|url\(", text)
    assert "default-src 'none'" in text


def test_the_same_results_give_the_same_report(three: Path) -> None:
    write_report(three)
    first = (three / "report.html").read_bytes()
    write_report(three)
    assert (three / "report.html").read_bytes() == first


def test_hostile_names_stay_text(three: Path) -> None:
    write_report(three)
    data = held(three)
    assert [row["policy"] for row in data["statistics"]["policies"]] == ["sure", "once", STRANGE]
    assert HOSTILE in [field["name"] for field in data["browser"]["fields"]]


def test_rare_failures_come_first_and_then_the_largest_gaps(three: Path) -> None:
    write_report(three)
    browser = held(three)["browser"]
    names = [browser["fields"][scene["field"]]["name"] for scene in browser["scenes"]]
    assert names == ["standard/train:1", "standard/train:0", "standard/train:2", HOSTILE]
    assert browser["total"] == 4
    assert browser["note"] == ""
    runs = browser["scenes"][0]["runs"]
    assert [(run["policy"], run["success"]) for run in runs] == [(0, True), (1, False), (2, False)]
    assert runs[1]["gap"] is None
    assert runs[1]["outcome"] == "collision"
    assert runs[0]["gap"] == pytest.approx(150.0 / 140.0 - 1.0, abs=1e-6)


def test_beyond_the_budget_a_report_says_what_it_left_out(tmp_path: Path) -> None:
    fields = {f"x{k}": [140.0 + k] for k in range(400)}
    fields["x7"] = [None]
    write_results(tmp_path, {"a": fields})
    write_report(tmp_path, budget=20_000)
    browser = held(tmp_path)["browser"]
    shown = len(browser["scenes"])
    assert 10 < shown < 200
    assert len(json.dumps(browser, separators=(",", ":"))) < 30_000
    assert f"{shown} of 400 pairs of field and seed: 1 of the 1 with failures" in browser["note"]
    names = [browser["fields"][scene["field"]]["name"] for scene in browser["scenes"]]
    assert names[:4] == ["x7", "x399", "x398", "x397"]


@pytest.mark.parametrize("failing", [0.0, 0.3, 1.0])
def test_whatever_the_budget_the_paths_shown_are_those_flown(
    failing: float, tmp_path: Path
) -> None:
    stream = np.random.default_rng(0)
    lengths: dict[str, dict[str, list[float | None]]] = {
        policy: {
            f"x{k}": [
                None if stream.random() < failing else float(stream.uniform(141.0, 190.0))
                for _ in range(3)
            ]
            for k in range(40)
        }
        for policy in ("a", "b")
    }
    write_results(tmp_path, lengths)
    number = []
    for budget in (1, 3_000, 10_000, 30_000, 1_000_000):
        write_report(tmp_path, budget=budget)
        browser = held(tmp_path)["browser"]
        number.append(len(browser["scenes"]))
        for scene in browser["scenes"]:
            name = browser["fields"][scene["field"]]["name"]
            for run, policy in zip(scene["runs"], lengths, strict=True):
                length = lengths[policy][name][scene["seed"]]
                flown = chain(2) if length is None else chain(12, aside=length - 140.0)
                assert run["path"] == draw_chain(flown)
    assert number == sorted(number)
    assert number[0] == 1
    assert number[-1] == 120


def test_common_failures_do_not_fill_the_whole_budget(tmp_path: Path) -> None:
    fields = {f"x{k}": [None] for k in range(300)} | {f"y{k}": [150.0] for k in range(300)}
    write_results(tmp_path, {"a": fields})
    write_report(tmp_path, budget=20_000)
    scenes = held(tmp_path)["browser"]["scenes"]
    arrived = sum(scene["runs"][0]["success"] for scene in scenes)
    assert 5 < arrived < len(scenes) - arrived


def test_fields_are_those_handed_in_or_drawn_by_name(three: Path) -> None:
    odd = Field(name=HOSTILE, obstacles=Obstacles.discs([[50.0, 51.5]], [7.25]))
    write_report(three, {HOSTILE: odd})
    drawn = {field["name"]: field for field in held(three)["browser"]["fields"]}
    assert drawn[HOSTILE]["discs"] == [5000, 5150, 725]
    assert drawn[HOSTILE]["goal"] == [10000, 10000]
    named = get_field("standard/train:2")
    assert named.obstacles.are_discs
    discs = np.reshape(drawn["standard/train:2"]["discs"], (-1, 3)) / 100.0
    np.testing.assert_allclose(discs[:, :2], named.obstacles.centers, atol=0.005)
    np.testing.assert_allclose(discs[:, 2], named.obstacles.radii, atol=0.005)
    write_report(three)
    unknown = {field["name"]: field for field in held(three)["browser"]["fields"]}[HOSTILE]
    assert unknown["discs"] is unknown["shortest"] is None


def test_obstacles_of_every_shape_are_drawn(three: Path) -> None:
    box, wall = (
        Obstacles.boxes([[10, 20]], [[30, 50]]),
        Obstacles.capsules([[[60, 70], [80, 70]]], 2),
    )
    shapes = Obstacles.joined([box, Obstacles.discs([[50.0, 51.5]], [7.25]), wall])
    drawn = draw_obstacles(shapes)
    assert drawn["discs"] == [5000, 5150, 725]
    first, second = drawn["shapes"].split("z")[:-1]
    assert first == "M1000 2000l2000 0l0 3000l-2000 0"
    assert [arc[0] for arc in numbers(second) if len(arc) == 7] == [200.0] * 4


def test_a_file_is_never_taken_for_a_field_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine").write_text('{"centers": [[50, 50]], "radii": [5]}')
    write_results(tmp_path, {"a": {"mine": [150.0]}})
    monkeypatch.chdir(tmp_path)
    write_report(tmp_path)
    assert held(tmp_path)["browser"]["fields"][0]["discs"] is None


def numbers(path: str) -> list[list[float]]:
    return [
        [float(n) for n in re.findall(r"-?\d+", part)] for part in re.split("[A-Za-z]", path)[1:]
    ]


def test_a_drawn_chain_is_the_flown_curve() -> None:
    control = chain(5, aside=20.0)
    (start, first, *rest) = numbers(draw_chain(control))
    at = np.array(start)
    t = np.linspace(0.0, 1.0, 9)[:, None]
    before = at + first[:2]
    for k, step in enumerate([first[2:], *rest]):
        middle, end = at + step[:2], at + step[2:]
        bezier = (
            (1 - t) ** 3 * at
            + 3 * (1 - t) ** 2 * t * before
            + 3 * (1 - t) * t**2 * middle
            + t**3 * end
        )
        np.testing.assert_allclose(bezier / 100.0, evaluate(control[k], t[:, 0]), atol=0.03)
        at, before = end, 2.0 * end - middle
    assert draw_chain(np.empty((0, 4, 2))) == ""


def test_a_drawn_shortest_path_turns_with_its_discs() -> None:
    path = shortest_path(get_field("standard/train:0"))
    assert path is not None
    parts = numbers(draw_shortest(path))
    assert parts[0] == [0.0, 0.0]
    assert parts[-1] == [10000.0, 10000.0]
    arcs = [part for part in parts if len(part) == 7]
    assert [arc[4] for arc in arcs] == [float(sense > 0) for sense in path.senses]
    np.testing.assert_allclose([arc[0] for arc in arcs], 100.0 * path.radii, atol=0.5)


def test_policies_have_the_colours_that_they_have_in_the_picture() -> None:
    template = Path(report.__file__).with_name("template.html").read_text(encoding="utf-8")
    light = template[: template.index("prefers-color-scheme: dark")]
    assert tuple(re.findall(r"--c[0-9]: (#[0-9a-f]{6});", light)) == COLOURS


@pytest.mark.parametrize(
    ("lengths", "title", "sentence"),
    [
        ({}, "No flights", "This evaluation contains no flights."),
        ({"a": {"x": [None]}}, "1 policy on 1 field", "a has an SPL of 0.0000."),
        (
            {"a": {"x": [150.0], "y": [155.0]}, "b": {"x": [190.0], "y": [195.0]}},
            "2 policies on 2 fields",
            "It is significantly better than every other policy (paired 95 % intervals).",
        ),
        (
            {"a": {"x": [150, 160], "y": [160, 149.5]}, "b": {"x": [160, 150], "y": [150, 160]}},
            "2 policies on 2 fields",
            "The difference from b",
        ),
        (
            {"a": {"x": [150.0], "y": [155.0]}, "b": {"x": [150.002], "y": [155.002]}},
            "2 policies on 2 fields",
            "Its lead over b is negligible, below 5e-05.",
        ),
    ],
)
def test_the_headline_says_who_leads(
    tmp_path: Path, lengths: Mapping[str, Any], title: str, sentence: str
) -> None:
    write_results(tmp_path, lengths)
    (tmp_path / "paths.npz").unlink()
    write_report(tmp_path)
    found = held(tmp_path)["headline"]
    assert found["title"] == title
    assert sentence in " ".join(found["sentences"])


def test_a_report_says_what_each_policy_knows(tmp_path: Path) -> None:
    lengths = {
        "multi-start": {"x": [150.0], "y": [155.0]},
        "single-start": {"x": [160.0], "y": [170.0]},
        "guided": {"x": [141.0], "y": [142.0]},
        "runs/mine": {"x": [141.5], "y": [142.5]},
    }
    write_report(write_results(tmp_path, lengths))
    data = held(tmp_path)
    knows = {one["policy"]: one["knows"] for one in data["statistics"]["policies"]}
    assert knows == {
        "multi-start": "nearby",
        "single-start": "nearby",
        "guided": "whole field",
        "runs/mine": None,
    }
    assert list(data["knowledge"]) == ["whole field", "nearby", "?"]
    first, second, *_ = data["headline"]["sentences"]
    assert first.startswith("guided (whole field) has the highest SPL, 0.98")
    assert second.startswith("Of the policies listed as nearby, multi-start has the highest SPL")
    # what a summary records goes before the names, but not what is malformed
    rows = [{"policy": "runs/mine", "knows": "nearby"}, {"policy": "guided", "knows": 7}, "?"]
    summary = {"statistics": {"policies": rows}}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    write_report(tmp_path)
    again = {one["policy"]: one["knows"] for one in held(tmp_path)["statistics"]["policies"]}
    assert again == knows | {"runs/mine": "nearby"}


def test_the_summary_tells_how_results_were_made_and_times_of_all_decisions(three: Path) -> None:
    made = {
        "command": "ferguson evaluate",
        "machine": {"versions": {"numpy": "2"}},
        "policies": [
            {"policy": "once", "decision_seconds_99": 0.25, "stopped_by_clock": True},
            {"policy": "gone", "decision_seconds_99": 0.5},
        ],
        "statistics": {"policies": ["shown anyway"]},
    }
    (three / "summary.json").write_text(json.dumps(made))
    write_report(three)
    data = held(three)
    assert data["provenance"]["command"] == "ferguson evaluate"
    assert data["provenance"]["machine.versions.numpy"] == "2"
    assert data["provenance"]["policies.once.stopped_by_clock"] == "true"
    assert not any(key.startswith("statistics") for key in data["provenance"])
    times = [one.get("decision_seconds_99") for one in data["statistics"]["policies"]]
    assert times == [None, 0.25, None]
    assert "are not exactly reproducible: once." in " ".join(data["headline"]["sentences"])
    assert "With so few fields (4)" in " ".join(data["headline"]["sentences"])
    for wrong in ("{", "[]"):
        (three / "summary.json").write_text(wrong)
        with pytest.raises(ValueError, match=r"summary\.json: not"):
            write_report(three)


def test_paths_of_another_evaluation_are_refused(three: Path, tmp_path: Path) -> None:
    other = write_results(tmp_path / "other", {"a": {"x": [150.0]}})
    shutil.copy(other / "paths.npz", three)
    with pytest.raises(ValueError, match=r"has 1 flights and flights\.csv has 12"):
        write_report(three)
    (three / "paths.npz").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="does not hold the paths of flights"):
        write_report(three)
    assert not (three / "report.html").exists()


def test_data_keep_out_of_the_markup() -> None:
    text = page({"name": HOSTILE, "other": STRANGE})
    assert HOSTILE not in text
    assert text.count("</script>") == 2
