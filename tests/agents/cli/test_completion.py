"""Completion in a shell: real ones, of the script that the program prints."""

import shutil
import subprocess
from pathlib import Path

import pytest

from agents.cli.main import main

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")

TRAPS = ["traps/test:0-9", "traps/train:0-9", "traps/val:0-9"]
ASK = """
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
_shtab_ferguson 2>/dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""
"""Bash as it asks a completion function, with the words of a line."""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "ferguson.bash"
    capture = pytest.MonkeyPatch()
    with path.open("w") as file, capture.context() as patch:
        patch.setattr("sys.stdout", file)
        assert main(["--print-completion", "bash"]) == 0
    return path


def test_bash_accepts_the_script(script: Path) -> None:
    done = subprocess.run(["bash", "-n", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("ev", ["evaluate"]),
        ("bench ", ["env", "planners", "solvers"]),
        ("plan pa", ["paper:1"]),
        ("plan town", ["town.json", "town/test:0", "town/train:0", "town/val:0"]),
        ("plan paper:1 --planner s", ["shortest", "single-start"]),
        ("plan paper:1 --planner guided --plot tow", ["town.json"]),
        ("evaluate --policy be", ["best"]),
        ("evaluate --policy run", ["runs"]),
        (
            "evaluate --policy best --fields tr",
            TRAPS,
        ),
        ("evaluate --policy best --fields standard/test : 0-9 --q", ["--quiet"]),
        ("train dag", ["dagger"]),
        ("train ppo --from dagger-", ["dagger-ppo", "dagger-way"]),
        ("demos --observation ", ["both", "discs", "rays"]),
        ("plan paper:1 --limit s", ["segments=", "shortest=", "slowest="]),
        ("bench planners --planner rrt", ["rrt", "rrt-star"]),
    ],
)
def test_what_may_follow_is_offered(
    line: str, offered: list[str], script: Path, tmp_path: Path
) -> None:
    (tmp_path / "town.json").write_text("{}")
    (tmp_path / "runs").mkdir()
    done = subprocess.run(
        ["bash", "-c", ASK, "bash", script, "ferguson", *line.split(" ")],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    found = [word.replace("validation", "val") for word in done.stdout.split()]
    assert sorted(found) == offered


@pytest.mark.parametrize("shell", ["zsh", "fish", "tcsh"])
def test_other_shells_have_scripts_too(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--print-completion", shell]) == 0
    out = capsys.readouterr().out
    for word in ("evaluate", "print-completion"):
        assert word in out
