"""The pictures of learned agents are drawn from curves and flights, failures included."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

from ferguson_gym.world.field_names import get_field

pytest.importorskip("stable_baselines3")
CURVE = "steps,minutes,success,spl,gap\n0,0.5,0.0,0.0,\n1000,1.5,1.0,0.98,0.01\n"


@pytest.fixture
def picture(benchmark: Callable[[str], Any]) -> object:
    return benchmark("agents_picture")


def run(picture: object, monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["agents_picture.py", *words])
    picture.main()  # type: ignore[attr-defined]


def test_curves_are_drawn_with_their_references(
    picture: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "curve.csv").write_text(CURVE)
    out = tmp_path / "learning.svg"
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    told = ["--reference", "multi-start=0.96,0.99"]
    run(picture, monkeypatch, "curves", "--run", f"dagger={tmp_path}", *told, "--out", str(out))
    text = out.read_text()
    assert ">dagger<" in text
    assert ">multi-start 0.96<" in text
    assert ">multi-start 0.99<" in text


def test_failures_are_drawn_and_told(
    picture: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "agents.svg"
    monkeypatch.setitem(mpl.rcParams, "svg.fonttype", "none")
    policies = ["--policy", "guided", "--policy", "single-start"]
    fields = ["--fields", "standard/validation:4"]
    run(picture, monkeypatch, "flights", *policies, *fields, "--out", str(out))
    text = out.read_text()
    assert get_field("standard/validation:4").name in text
    assert "single-start: gave up, 0.0 m" in text
    assert "guided: 151.1" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["curves", "--run", "dagger=nowhere"], "no curve.csv in nowhere"),
        (["curves", "--run", "dagger"], "need NAME=DIR, got 'dagger'"),
        (["curves", "--run", "a=b", "--reference", "c=2"], "numbers from 0 to 1, got 'c=2'"),
        (["flights", "--policy", "nobody", "--fields", "paper:1"], "unknown policy 'nobody'"),
        (["flights", "--policy", "guided", "--fields", "paper:9"], "paper"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(
    picture: object,
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as stopped:
        run(picture, monkeypatch, *words, "--out", str(tmp_path / "picture.png"))
    assert stopped.value.code == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
