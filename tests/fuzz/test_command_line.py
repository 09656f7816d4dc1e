"""The program, with any arguments: an exit status, and one line for what was wrong."""

import contextlib
import io
import json
import warnings
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from agents.cli.main import main
from tests.fuzz.cases import fuzzed, note_refusal
from tests.fuzz.strategies import damaged
from tests.fuzz.test_fields import SAMPLE

GOOD_FIELDS = ("sparse/train:3", "paper:1", "forest/train:0", "field.json")
FIELDS = st.sampled_from(
    [
        *(
            *GOOD_FIELDS,
            "paper:9",
            "x",
            "",
            "standard/test:5-2",
            "nowhere.json",
            "taken",
            ".",
            "\x00",
        ),
        *(
            "a" * 300,
            "standard/train:" + "9" * 40,
            "traps/train:-1",
            "é:1",
            "paper:1-4",
            "broken.json",
        ),
    ]
)
PLANNERS = st.sampled_from(
    [
        *("single-start", "shortest", "pursuit", "guided", "voronoi", "guided+margin=1", "best"),
        *("", "x", "guided+", "guided+turn=x", "guided+turn=0", "shortest+shield", "best+tries=x"),
        *("single-start+from=", "single-start+from=x", "single-start+sensing=nan", "+", "taken"),
        *(
            "guided+shield+shield",
            "\x00",
            "a" * 300,
            "field.json",
            "guided\n",
            "pursuit+margin=1e400",
        ),
    ]
)
NUMBERS = st.sampled_from(
    [
        "0",
        "1",
        "3",
        "-1",
        "1.5",
        "nan",
        "inf",
        "x",
        "",
        "0-3",
        "3-1",
        "9" * 30,
        "٣",
        "1e3",
        "²",
        "1_0",
    ]
)
SOME = st.text(max_size=4) | st.sampled_from(
    ["--help", "--version", "-h", "--", "-", "--json", "-q", "--quiet", "--no-color", "--pl", "\r"]
)
PLACES = st.sampled_from(["taken", "taken/below", "\x00", "a" * 300, "/dev/null", "/proc/x"])
PICTURES = st.sampled_from(
    ["taken", "flight.png", "flight.svg", "flight.exe", "no/where.png", "", "."]
)


def options(**values: st.SearchStrategy[Any]) -> st.SearchStrategy[list[str]]:
    """Options with values, some of them; a value of None stands for a flag."""
    one = st.sampled_from(sorted(values)).flatmap(
        lambda name: values[name].map(
            lambda value: [f"--{name.replace('_', '-')}"] + ([] if value is None else [value])
        )
    )
    return st.lists(one, max_size=4).map(lambda parts: [word for part in parts for word in part])


FLAG = st.none()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working directory with a field, a damaged one, and a file that is in the way."""
    home = tmp_path_factory.mktemp("home")
    (home / "field.json").write_bytes(SAMPLE)
    (home / "broken.json").write_bytes(SAMPLE[:40])
    (home / "taken").write_text("a file")
    return home


def ferguson(home: Path, words: list[str]) -> tuple[int, str]:
    """Exit status and standard output, after what the program promises was seen to."""
    out, err = io.StringIO(), io.StringIO()
    with (
        warnings.catch_warnings(),
        contextlib.chdir(home),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        warnings.simplefilter("default")  # they are reported, and are not errors
        status = main(words)
    assert status in (0, 1, 2), status
    if status == 2:
        note_refusal()
    told = [line for line in err.getvalue().splitlines() if "warning: " not in line]
    if status == 2 and told[0].startswith("usage: "):
        assert not words or "bench" in words  # with nothing that it compares: its help
    elif status == 2:
        assert len(told) == 1, told
        assert told[0].startswith("ferguson"), told
        assert not out.getvalue()
    assert "Traceback" not in err.getvalue() + out.getvalue()
    return status, out.getvalue()


@fuzzed(
    "command line: any words",
    few=10,
    many=8000,
    words=st.lists(
        st.sampled_from(
            [
                *("plan", "evaluate", "animate", "demos", "bench", "env", "planners", "solvers"),
                *("train", "ppo", "--fields", "--out", "--planner", "--seed", "--help", "--json"),
            ]
        )
        | SOME
        | NUMBERS,
        max_size=6,
    ).filter(lambda words: words[:1] != ["train"] and words[:2] != ["bench", "env"]),
)
def test_any_words_are_understood_or_refused(home: Path, words: list[str]) -> None:
    ferguson(home, words)


@fuzzed(
    "command line: plan",
    few=6,
    many=3000,
    field=FIELDS,
    planner=PLANNERS,
    more=options(
        seed=NUMBERS,
        sensing_range=NUMBERS,
        turn_radius=NUMBERS,
        backtrack=FLAG,
        start_from=PLANNERS,
        json=FLAG,
        plot=PICTURES,
    ),
    extra=st.none() | SOME,
)
def test_a_field_is_planned_or_refused(
    home: Path, field: str, planner: str, more: list[str], extra: str | None
) -> None:
    words = ["plan", field, "--planner", planner, *more, *([] if extra is None else [extra])]
    status, out = ferguson(home, words)
    if "--json" in more and status < 2 and out.startswith("{"):
        found = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
        assert found["success"] == (status == 0) == (found["length"] is not None)


@fuzzed(
    "command line: evaluate",
    few=4,
    many=2500,
    policies=st.lists(PLANNERS, min_size=1, max_size=3),
    fields=st.lists(FIELDS, min_size=1, max_size=2),
    more=options(
        seeds=NUMBERS,
        workers=st.sampled_from(["1", "0", "x", ""]),
        batch=NUMBERS,
        fresh=FLAG,
        backend=st.sampled_from(["processes", "dask", "x", ""]),
        address=st.sampled_from(["", "x", "127.0.0.1:1", "127.0.0.1:99999", "[::1]:x"]),
    ),
    out=PLACES,
)
def test_an_evaluation_that_cannot_be_is_refused(
    home: Path, policies: list[str], fields: list[str], more: list[str], out: str
) -> None:
    words = [word for policy in policies for word in ("--policy", policy)]
    words += [word for field in fields for word in ("--fields", field)]
    before = sorted(home.iterdir())
    status, _ = ferguson(home, ["evaluate", *words, "--out", out, *more])
    assert status == 2
    assert sorted(home.iterdir()) == before


@fuzzed(
    "command line: demos",
    few=3,
    many=2000,
    expert=PLANNERS,
    fields=st.lists(FIELDS, min_size=1, max_size=2),
    out=st.sampled_from(["x", "", "a/b", "../up-v0", "/abs-v0", "x-v", "\x00-v0", "a b-v0"]),
    more=options(observation=SOME, nearest=NUMBERS, rays=NUMBERS, workers=NUMBERS, fresh=FLAG),
)
def test_demonstrations_that_cannot_be_are_refused(
    home: Path, expert: str, fields: list[str], out: str, more: list[str]
) -> None:
    words = [word for field in fields for word in ("--fields", field)]
    status, _ = ferguson(home, ["demos", "--expert", expert, *words, "--out", out, *more])
    assert status == 2 or "--help" in more or "-h" in more


@fuzzed(
    "command line: train",
    few=3,
    many=2000,
    algorithm=st.sampled_from(["ppo", "tqc", "bc", "dagger", "x", ""]),
    more=options(
        config=st.sampled_from(["ppo", "x", "", "taken", "field.json", ".", "\x00"]),
        seed=NUMBERS,
        steps=NUMBERS,
        minutes=NUMBERS,
        demos=st.sampled_from(["x", "a/b-v0", "", "../a-v0"]),
        choose_on=FIELDS,
        report_on=FIELDS,
        workers=NUMBERS,
        threads=NUMBERS,
        fresh=FLAG,
        **{"from": PLANNERS},
    ),
    out=PLACES,
)
def test_a_training_that_cannot_be_is_refused(
    home: Path, algorithm: str, more: list[str], out: str
) -> None:
    pytest.importorskip("sb3_contrib")
    assert ferguson(home, ["train", algorithm, "--out", out, *more])[0] == 2


@fuzzed(
    "command line: bench",
    few=3,
    many=2000,
    subject=st.sampled_from(["planners", "solvers", "env", "x"]),
    more=options(
        fields=FIELDS,
        planner=PLANNERS,
        seeds=NUMBERS,
        seconds=NUMBERS,
        workers=NUMBERS,
        windows=NUMBERS,
        ipopt_every=NUMBERS,
        observation=SOME,
        rounds=NUMBERS,
        seed=NUMBERS,
    ),
    out=PLACES,
)
def test_a_benchmark_that_cannot_be_is_refused(
    home: Path, subject: str, more: list[str], out: str
) -> None:
    status, _ = ferguson(home, ["bench", subject, "--out", out, *more])
    assert status == 2 or "--help" in more or "-h" in more or "--version" in more


@fuzzed(
    "command line: animate",
    few=3,
    many=2000,
    field=FIELDS,
    policy=PLANNERS,
    more=options(seed=NUMBERS),
    out=st.sampled_from(["taken", "x.png", "no/x.gif", "", ".", "a" * 300 + ".gif", "\x00.gif"]),
)
def test_an_animation_that_cannot_be_is_refused(
    home: Path, field: str, policy: str, more: list[str], out: str
) -> None:
    assert ferguson(home, ["animate", field, "--policy", policy, "--out", out, *more])[0] == 2


@fuzzed(
    "command line: field files",
    few=3,
    many=3000,
    text=damaged(SAMPLE),
    planner=st.sampled_from(["shortest", "pursuit"]),
)
def test_a_damaged_field_is_planned_or_refused(home: Path, text: bytes, planner: str) -> None:
    (home / "damaged.json").write_bytes(text)
    try:
        ferguson(home, ["plan", "damaged.json", "--planner", planner, "--json"])
    finally:
        (home / "damaged.json").unlink()
