"""Command lines that are refused: at once, in one line that names the way out, writing nothing."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from agents.cli.main import main

EVALUATE = "evaluate --out results --fields paper:1 --policy"
FIELDS = "evaluate --out results --policy guided --fields"
GUIDED = "evaluate --out results --fields paper:1 --policy guided"
PLAN = "plan paper:1 --planner guided"
DEMOS = "demos --expert guided --fields sparse/train:0"
TRAIN = "train ppo --out runs"
PLANNERS = "bench planners --out results --fields paper:1"
OF_PLANNERS = {
    f"{EVALUATE} giuded": "unknown policy 'giuded' (did you mean 'guided'?); policies are",
    f"{EVALUATE} mulit-start": "(did you mean 'multi-start'?)",
    f"{EVALUATE} ''": "unknown policy ''; policies are single-start",
    f"{EVALUATE} taken": "unknown policy 'taken'; policies are single-start",
    f"{EVALUATE} guided+tries=4": "unknown option 'tries=4' of planner 'guided'; need NAME+turn",
    f"{EVALUATE} guided+sensng=20": "unknown option 'sensng=20' of planner 'guided' (did you mean "
    "'sensing'?)",
    f"{EVALUATE} guided+": "unknown option '' of planner 'guided'",
    f"{EVALUATE} guided+backtrack=1": "unknown option 'backtrack=1'",
    f"{EVALUATE} guided+turn=3+turn=4": "carries an option twice",
    f"{EVALUATE} guided+turn=-1": "a turn radius to keep must be finite and above",
    f"{EVALUATE} guided+turn=nan": "got nan m; omit it to allow any turn",
    f"{EVALUATE} guided+turn=3+sensing=20": "leave one out",
    f"{EVALUATE} multi-start+turn=3": "'multi-start' keeps no turn radius; guided does",
    f"{EVALUATE} guided+sensing=1": "at least the longest segment, 15 m in field paper:1, got 1 m",
    f"{EVALUATE} guided+sensing=": "a sensing range is a number of metres, got ''",
    f"{EVALUATE} guided+margin=0": "a margin must be above 0 m and finite, got 0 m",
    f"{EVALUATE} shortest+backtrack": "'shortest' plans its whole path at once",
    f"{EVALUATE} shortest+shield": "shield an agent, or a planner that decides step by step",
    f"{EVALUATE} guided+shield+shield": "has a shield already",
    f"{EVALUATE} guided+from=multi-start": "single-start and multi-start do",
    f"{EVALUATE} multi-start+from=nobody": "unknown policy 'nobody'",
    f"{EVALUATE} {'x' * 5000}": "unknown policy 'xxx",
    f"{FIELDS} paper:5": "the paper has fields 1 to 4, not 5",
    f"{FIELDS} paper:": "unknown field 'paper:': fields are named paper:1 to paper:4",
    f"{FIELDS} standard/test": "unknown field 'standard/test': fields are named",
    f"{FIELDS} standard/test:1-2-3": "unknown field 'standard/test:1-2-3'",
    f"{FIELDS} standard/tset:1": "unknown split 'tset' (did you mean 'test'?)",
    f"{FIELDS} standrad/test:1": "unknown suite 'standrad' (did you mean 'standard'?)",
    f"{FIELDS} standard/test:5-3": "empty range in 'standard/test:5-3'",
    f"{FIELDS} standard/test:{10**19}": "lies between 0 and 2**63 - 1",
    f"{FIELDS} standard/test:{'9' * 5000}": "unknown field 'standard/test:999",
    f"{FIELDS} standard/test:0-99999999999": "at most 10000000 flights",
    f"{FIELDS} standard/test:0-{2**63 - 1}": f"got {2**63}",
    f"{FIELDS} empty": "no JSON files in directory 'empty'",
    f"{FIELDS} taken": "taken: not JSON",
    f"{FIELDS} deep.json": "deep.json: ",
    f"{FIELDS} binary.json": "binary.json: ",
    "animate paper:1 --policy guided --out a\0b.gif": "character that no file's may: 'a\\x00b.gif'",
    "plan paper:1 --planner guided --plot a\0b.png": "character that no file's may: 'a\\x00b.png'",
    f"{GUIDED} --seeds 3-1": "empty range of seeds '3-1'",
    f"{GUIDED} --seeds -1": "seeds are a number or A-B, got '-1'",
    f"{GUIDED} --seeds {'9' * 5000}": "a seed is at most 2**63 - 1",
    f"{GUIDED} --seeds 0-{2**63 - 1}": "at most 10000000 flights",
    f"{GUIDED} --workers 0": "need an integer >= 1, got '0'",
    f"{GUIDED} --workers 100000": "at most 1024 processes or threads, got 100000",
    f"{GUIDED} --batch 1.5": "need an integer >= 1, got '1.5'",
    f"{GUIDED} --backend slurm": "unknown backend 'slurm'; backends are processes, dask",
    f"{GUIDED} --address a:1": "add --backend dask",
    f"{GUIDED} --wrokers 2": "unrecognized arguments: --wrokers 2 (did you mean '--workers'?)",
    f"{GUIDED} --see 1": "unrecognized arguments: --see 1",
    f"{GUIDED} guided": "unrecognized arguments: guided",
    "evaluate --policy guided --fields paper:1 --out ''": "need the path of a directory, got ''",
    "evaluate --policy guided --fields paper:1 --out /dev/null": "/dev/null is a file",
    "evalute": "invalid choice: 'evalute' (did you mean 'evaluate'?); choose from plan",
    "plan": "required: FIELD, --planner (see ferguson plan --help)",
    "plan paper:1 --planner best": "'best' is an agent, not a planner; use ferguson",
    f"{PLAN} --limit longets=30": "unknown limit 'longets' (did you mean 'longest'?); limits are",
    f"{PLAN} --limit longest": "a limit is NAME=VALUE, for example longest=30, got 'longest'",
    f"{PLAN} --limit longest=x": "limit longest is a number, got 'x'",
    f"{PLAN} --limit longest=nan": "limit longest must be finite, got nan",
    f"{PLAN} --limit gate=1 --limit gate=2": "limit gate is given twice",
    f"{PLAN} --limit segments=2.5": "limit segments must be a whole number, got 2.5",
    f"{PLAN} --limit longest=30 --sensing-range 20": "at least the longest segment, 30 m in field",
    f"{GUIDED} --limit gate=4": "paper:1, with gate 4 m: need 0 <= gate < shortest, got 4.0 m and",
    f"{PLANNERS} --limit shortest=20": "with shortest 20 m: need 0 < shortest < longest",
    "bench solvers --fields paper:1 --out results --ipopt-every 0 --limit gate=4": "with gate 4 m",
    "animate paper:1 --policy guided --out a.gif --limit tolerance=1": "with tolerance 1 m: need",
    f"{PLAN} --turn-radius x": "need a number of metres, got 'x'",
    f"{PLAN} --plot ''": "pictures are written as .png, .pdf, .svg",
    f"{PLAN} --plot empty": "pictures are written as .png, .pdf, .svg, not 'empty'",
    f"{PLAN} --start-from guided": "takes no starts from an agent",
    f"{DEMOS} --out d": "a dataset's id is NAME-vN or NAMESPACE/NAME-vN",
    f"{DEMOS} --out d-v0 --observation radar": "'radar'; choose from discs, rays, both",
    f"{DEMOS} --out d-v0 --rays 99999999": "need rays from 1 to 10000, got 99999999",
    f"{DEMOS} --out d-v0 --fields sparse/train:0-{2**63 - 1}": "at most 1000000 flights",
    f"{PLANNERS} --planner giuded": "unknown planner 'giuded' (did you mean 'guided'?)",
    f"{PLANNERS} --seconds -1": "need a positive number of seconds, got '-1'",
    f"{PLANNERS} --fields sparse/train:0-99999999": "at most 1000000 flights",
    "bench solvers --out taken --ipopt-every 0": "taken is a file, not a directory",
    "bench solvers --out results --windows 0": "an integer >= 1, got '0'",
    "bench env --seconds nan": "need a positive number of seconds, got 'nan'",
    "bench kites": "invalid choice: 'kites'; choose from planners, solvers, env",
    "animate paper:1 --policy guided --out flight.png": "animations are written as .gif",
    "animate paper:1-2 --policy guided --out flight.gif": "'paper:1-2' names more than one field",
    "--print-completion cmd": "invalid choice: 'cmd'; choose from bash, zsh",
}
"""Which need no agent, and so nothing that is not installed by default."""
OF_AGENTS = {
    f"{EVALUATE} best+tries=0": "got 0",
    f"{EVALUATE} best+tries=x": "need an integer >= 1 after +tries=, got 'x'",
    f"{EVALUATE} best+tries=99999999999": "got 99999999999",
    f"{EVALUATE} best+shield+shield": "'best+shield' has a shield already",
    f"{EVALUATE} half": "model.json is missing; a model is a directory with model.zip and",
    "train luck --out runs": "'luck'; choose from ppo, tqc, bc, dagger",
    f"{TRAIN} --minutes 0": "need a positive number of minutes, got '0'",
    f"{TRAIN} --threads 99999": "at most 1024 processes or threads, got 99999",
    f"{TRAIN} --from dager": "no such model (did you mean 'dagger'?)",
    f"{TRAIN} --from half": "model.json is missing",
    f"{TRAIN} --config no.yml": "no hyperparameters at no.yml: need a YAML file, or bc, dagger",
    f"{TRAIN} --config taken": "taken: need the key ferguson/ObstacleField-v0 at the top",
    f"{TRAIN} --demos d-v0": "ppo cannot use --demos; tqc, bc, dagger can",
    f"{TRAIN} --choose-on nope": "unknown field 'nope'",
    f"{TRAIN} --report-on sparse/test:0-9999999": "at most 100000 flights",
    "train ppo --out taken": "taken is a file, not a directory",
    "train ppo --out half": "half holds other files; choose a new directory",
    "train bc --out runs": "name them with --demos DATASET_ID",
    "animate paper:1 --policy best --out flight.gif": "'best' is an agent; planners are",
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory in which some names are taken."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "binary.json").write_bytes(bytes(range(256)))
    for name in ("empty", "half"):
        (tmp_path / name).mkdir()
    (tmp_path / "half" / "model.zip").write_text("no model")
    return tmp_path


def contents(place: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in place.rglob("*")}


def is_refused(line: str, told: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(place)
    assert main(shlex.split(line)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("ferguson")
    assert len(err) < 1000
    assert told in err
    assert contents(place) == before


@pytest.mark.parametrize("line", OF_PLANNERS, ids=lambda line: line[-60:])
def test_a_bad_line_is_refused(line: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if line.startswith("demos"):
        pytest.importorskip("minari")
    is_refused(line, OF_PLANNERS[line], place, capsys)


@pytest.mark.parametrize("line", OF_AGENTS, ids=lambda line: line[-60:])
def test_a_bad_line_on_agents_is_refused(
    line: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("sb3_contrib")
    is_refused(line, OF_AGENTS[line], place, capsys)


def test_planners_are_refused_without_the_libraries_of_agents(place: Path) -> None:
    program = (
        "import sys, json\n"
        "from agents.cli.main import main\n"
        "status = {main(line) for line in json.load(sys.stdin)}\n"
        "heavy = ('torch', 'minari', 'distributed')\n"
        "print(status, [name for name in heavy if name in sys.modules])"
    )
    lines = [shlex.split(line) for line in OF_PLANNERS if not line.startswith("demos")]
    done = subprocess.run(
        [sys.executable, "-c", program], input=json.dumps(lines), capture_output=True, text=True
    )
    assert done.stdout == "{2} []\n", done.stderr
