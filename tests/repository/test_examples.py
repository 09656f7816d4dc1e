"""The examples run as documented; their output and pictures are correct."""

import re
import runpy
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from agents.cli.main import main
from agents.flights.flight import fly
from agents.policies.planner_policies import planner_policy
from ferguson_gym.curves.path import Path as Curve
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field_names import get_field, get_fields
from planners.interface import initial_state
from tests.support.places import ROOT

EXAMPLES = ROOT / "examples"
Run = Callable[..., tuple[dict[str, Any], str]]


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Run]:
    """Runs an example in an empty directory: its names, and what it printed."""
    monkeypatch.chdir(tmp_path)

    def runs(name: str, *words: str) -> tuple[dict[str, Any], str]:
        monkeypatch.setattr(sys, "argv", [name, *words])
        names = runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return names, capsys.readouterr().out

    with mpl.rc_context():
        yield runs
    plt.close("all")


def assert_drawn(picture: str) -> None:
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB"))
    assert min(pixels.shape[:2]) >= 350
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50  # a blank one has a colour or two
    assert 0.02 < (pixels.min(axis=2) < 250).mean() < 0.9


def printed_command(text: str) -> list[str]:
    line = text.rstrip().splitlines()[-1].split()
    assert line[0] == ".venv/bin/ferguson"
    return line[1:]


def test_the_hand_written_rule_arrives_in_nine_fields_of_ten(run: Run) -> None:
    _, text = run("fly.py", "--seed", "3")
    assert "standard/train:3: reached the goal\n" in text
    assert int(re.search(r"(\d+) of 100 arrived", text)[1]) >= 90
    assert_drawn("results/examples/fly.png")


def test_the_own_planner_flies_what_it_plans_and_is_measured_as_others(run: Run) -> None:
    names, text = run("own_planner.py", "--fields", "standard/train:0-3", "--beside", "guided")
    planner = names["Shooting"]()
    fields = list(get_fields("standard/train:0-3"))
    gaps = []
    for field in fields:
        flight = fly(planner_policy(planner), field, seed=0, name="shooting")
        plan = planner.plan(field, initial_state(field), 0)
        assert flight.control.tobytes() == plan.control.tobytes()
        assert is_feasible(flight.control, field).all()
        if flight.success:
            assert (flight.control[-1, 1] == field.goal).all()
            gaps.append(100 * (Curve(flight.control).length / shortest_path(field).length - 1))
    assert len(gaps) >= 3
    told = re.search(r"shooting +nearby +(\d+)/4 +([\d.]+) % +([\d.]+) %", text)
    assert told.groups() == (str(len(gaps)), f"{np.median(gaps):.2f}", f"{max(gaps):.2f}")
    guided = re.search(r"guided +whole field +4/4 +([\d.]+) %", text)
    assert float(guided[1]) < 0.1 < np.median(gaps)


def test_the_own_agent_is_trained_on_its_reward_and_evaluated_by_its_path(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("stable_baselines3")
    from agents.models import torch_model

    few = ["--fields", "sparse/validation:23-26"]  # the way is free in the first
    _, text = run("own_agent.py", "--steps", "4096", *few)
    assert re.search(r"homing +1/4   SPL 0\.250\n", text)
    assert re.search(r"untrained +0/4   SPL 0\.000\n", text)
    assert main(printed_command(text)) == 0
    assert "own-agent" in capsys.readouterr().out
    before, after = (
        torch_model.load(f"results/examples/{name}").policy.state_dict()
        for name in ("untrained", "own-agent")
    )
    assert any((after[key] != before[key]).any() for key in before)


def test_the_own_reward_charges_for_nearness_alone(run: Run) -> None:
    pytest.importorskip("stable_baselines3")
    names = runpy.run_path(str(EXAMPLES / "own_agent.py"))
    plain, priced = (names["ObstacleFieldVecEnv"](16, **names["SEEN"]) for _ in range(2))
    wrapped = names["Keeping"](priced)
    for envs in (plain, wrapped):
        envs.seed(0)
        envs.reset()
    charged = 0
    for _ in range(20):
        seen, rewards, _, _ = plain.step(np.zeros((16, 4), np.float32))
        less = rewards - wrapped.step(np.zeros((16, 4), np.float32))[1]
        near = 30.0 * seen["rays"].min(axis=1) < 3.0
        assert (less[near] > 0.0).all()
        assert (less[~near] == 0.0).all()
        charged += near.sum()
    assert charged > 10


def test_the_town_is_flown_without_touching_a_wall(run: Run) -> None:
    _, text = run("own_field.py")
    exact = [float(way) for way in re.findall(r"m +([\d.]+) m +[\d.]+ m, reached the goal", text)]
    assert exact[0] < exact[1] < exact[2] - 10.0  # a wide vehicle does not fit into the alley
    assert re.search(r"(\d+) of \1 segments certified feasible", text)
    assert_drawn("results/examples/town.png")

    field = get_field("results/examples/town.json")
    assert shortest_path(field).length == pytest.approx(exact[1], abs=0.006)
    flight = fly("guided", field)
    walls = runpy.run_path(str(EXAMPLES / "own_field.py"))["read"](EXAMPLES / "buildings.csv")
    assert walls.clearance(flight.control).min() >= 0.8 - 1e-5
    assert main(printed_command(text)) == 0


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("x,y\n1,2\n", "need columns x, y, width, depth"),
        ("x,y,width,depth\n", "need buildings"),
        ("x,y,width,depth\n1,2,-3,4\n", "above 0 m"),
        ("x,y,width,depth\n1,2\n", "could not convert"),
        ("x,y,width,depth\n-5,-5,9,9\n", "inside obstacle 0"),
    ],
)
def test_bad_buildings_are_refused_in_one_line(
    lines: str, words: str, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("town.csv").write_text(lines)
    with pytest.raises(SystemExit) as stop:
        run("own_field.py", "--buildings", "town.csv")
    assert stop.value.code == 2
    assert words in capsys.readouterr().err.splitlines()[-1]
    assert [path.name for path in Path().iterdir()] == ["town.csv"]


def test_the_walk_through_the_paper_shows_what_it_says(run: Run) -> None:
    names, text = run("paper_walk.py", "--seeds", "1")
    for number in (1, 2, 3, 4):
        assert_drawn(f"results/examples/walk-{number}.png")
    # a random start finds the way past the obstacle at which the last plan ends
    assert names["names"][0] == "shifted"
    assert min(names["values"]) < names["values"][0] - 5.0
    # the objective is the formula on the page
    for d, ratio, f in re.findall(r"d = +([\d.]+) m, l / l_min = ([\d.]+), f = +([\d.]+) m", text):
        assert float(f) == pytest.approx(float(d) * (1 + 0.2 * float(ratio)), abs=0.06)
    assert "12 unknowns" in text
    assert names["certified"].all()
    rows = re.findall(r"paper:\d +([\d.]+) m +11 +([\d.]+) m .* ([\d.]+) m\n", text)
    assert len(rows) == 4
    for paper, ours, exact in np.array(rows, float):
        assert exact <= ours <= 1.01 * paper


def test_the_table_of_examples_names_them_all() -> None:
    text = (EXAMPLES / "README.md").read_text()
    scripts = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert sorted(re.findall(r"\| \[(\w+\.py)\]\(\1\) \|", text)) == scripts
    assert re.findall(r"^\.venv/bin/python examples/(\S+)$", text, re.MULTILINE) == re.findall(
        r"\| \[(\w+\.py)\]", text
    )
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (EXAMPLES / link).exists(), link
