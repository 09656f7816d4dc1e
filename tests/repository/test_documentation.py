"""The pages of docs/ do what they say: their Python runs, their commands are commands, links lead.

That the pages build without a warning is part of `make check`.
"""

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

import pytest

from agents.cli.main import _parser, main
from planners.registry import PLANNERS
from tests.support.documents import PAGES, README, ROOT, Block, blocks, commands_of, reduced

LANGUAGES = {"python", "sh", "json", "toml", "{toctree}"}
SHELL = [block for page in PAGES for block in blocks(page, "sh")]
FERGUSON, PYTHON = ".venv/bin/ferguson", ".venv/bin/python"
TWO_FIELDS = "standard/validation:0-1"
BESIDES = {
    (FERGUSON, "train"): ["--choose-on", TWO_FIELDS, "--report-on", TWO_FIELDS],
    ("benchmarks/learnability.py", "study"): ["--steps", "600"],
    # half a million steps pass before it evaluates, and keeps a policy
    ("benchmarks/learnability.py", "train"): ["--minutes", "4"],
}
"""What is said besides to commands that would take long, or do nothing in less."""
FILE = re.compile(r"`((?:agents|benchmarks|docs|examples|ferguson_gym|planners|tests)/[\w./-]+)`")
RECIPES = "recipes.md"
"""Its programs need libraries that are not installed here; `test_recipes.py` runs them."""
FOOTPRINTS = ".geojson"
"""They need a library that need not be installed."""
CLUSTER = "dask"
"""Other tests start a scheduler, and fly with its workers."""


def name_of(page: Path) -> str:
    return page.relative_to(ROOT / "docs").as_posix()


def pages_with(*languages: str) -> list[Path]:
    return [page for page in PAGES if any(block.language in languages for block in blocks(page))]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory with what commands name of a checkout, in which they may write."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    (tmp_path / "docs" / "images").mkdir(parents=True)
    (tmp_path / "docs" / "pictures.py").symlink_to(ROOT / "docs" / "pictures.py")
    for folder in ("benchmarks", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    return tmp_path


def run_python(block: Block) -> None:
    with patch.dict(PLANNERS):
        exec(compile(block.text, str(block), "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize(
    "page", [page for page in pages_with("python") if page.name != RECIPES], ids=name_of
)
def test_python_runs_in_the_order_of_the_page(page: Path, place: Path) -> None:
    for block in blocks(page):
        if block.language == "python":
            run_python(block)
        elif block.language == "sh":  # of the commands, those that make data sets
            for words in commands_of(block):
                if words[:2] == [FERGUSON, "demos"]:
                    assert main(reduced(words[1:])) == 0, words


@pytest.mark.parametrize("block", SHELL, ids=str)
def test_commands_exist_and_take_their_arguments(block: Block) -> None:
    for words in commands_of(block):
        if words[0] == FERGUSON:
            options = _parser().parse_args(words[1:])
            assert callable(options.prepare)
        elif words[0] == PYTHON:
            assert (ROOT / words[1]).is_file(), words
        else:
            assert words[0] == CLUSTER, f"{block}: what is {words[0]}?"


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("sh"), ids=name_of)
def test_commands_run_one_after_the_other(page: Path, place: Path) -> None:
    for block in blocks(page, "sh"):
        for words in commands_of(block):
            if CLUSTER in words or (FOOTPRINTS in str(words) and find_spec("shapely") is None):
                continue
            program, *few = reduced(words)
            few += next((more for key, more in BESIDES.items() if set(key) <= set(words)), [])
            if program == FERGUSON:
                assert main(few) == 0, words
            else:
                run_script(few, place)


def run_script(words: list[str], place: Path) -> None:
    """Run a script of the checkout, which writes below its output directory."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, *words], cwd=place, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{words}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_block_is_of_a_language_that_is_tested(page: Path) -> None:
    for block in blocks(page):
        assert block.language in LANGUAGES, block
    rest = page.read_text(encoding="utf-8")
    for block in blocks(page):
        rest = rest.replace(block.text, "")
    # an indented block would be neither coloured nor tested
    assert not re.search(r"\n\n {4,}\S", rest)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_and_files_that_are_named_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for link in re.findall(r"\]\((?!https?:)([^)#]*)(?:#[^)]*)?\)", text):
        assert not link or (page.parent / link).exists(), link
    for file in re.findall(
        r"`((?:agents|benchmarks|docs|examples|ferguson_gym|planners|tests)/[\w./-]+)`", text
    ):
        assert (ROOT / file).exists(), file


def test_every_picture_is_shown_somewhere() -> None:
    shown = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    shown += README.read_text(encoding="utf-8")
    for picture in (ROOT / "docs" / "images").iterdir():
        assert f"images/{picture.name})" in shown, picture
