"""The recipes of docs/recipes.md run, each where its library is installed."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.documents import Block, blocks
from tests.support.places import ROOT

PAGE = ROOT / "docs" / "recipes.md"
RECIPES = blocks(PAGE, "python")
STEPS = re.compile(r"^STEPS = [0-9_]+$", re.MULTILINE)
FEW = "STEPS = 200"
NEEDS = {
    "Stable-Baselines3": ("stable_baselines3",),
    "RL Zoo": ("rl_zoo3",),
    "CleanRL": ("torch",),
    "TorchRL": ("torchrl", "tensordict"),
    "RLlib": ("ray",),
    "Tianshou": ("tianshou", "rliable"),
    "skrl": ("skrl",),
    "d3rlpy": ("d3rlpy", "minari"),
    "Minari": ("minari",),
}
"""The recipes, and the modules that each needs."""


def title_of(block: Block) -> str:
    """The heading above a block."""
    above = PAGE.read_text(encoding="utf-8").splitlines()[: block.line]
    return next(line for line in reversed(above) if line.startswith("## ")).removeprefix("## ")


def test_every_library_has_a_recipe_and_its_versions() -> None:
    titles = [title_of(block) for block in RECIPES]
    assert titles == list(NEEDS)
    table = PAGE.read_text(encoding="utf-8").partition("## ")[0]
    for title in titles:
        assert f"\n| [{title}](#{title.lower().replace(' ', '-')}) |" in table


@pytest.mark.parametrize("block", RECIPES, ids=title_of)
def test_a_recipe_is_a_program_whose_length_one_line_sets(block: Block) -> None:
    compile(block.text, str(block), "exec")
    assert len(STEPS.findall(block.text)) == (title_of(block) != "Minari")


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("block", RECIPES, ids=title_of)
def test_a_recipe_runs(block: Block, tmp_path: Path) -> None:
    needed = NEEDS[title_of(block)]
    if absent := [name for name in needed if importlib.util.find_spec(name) is None]:
        pytest.skip(f"{', '.join(absent)} not installed; docs/recipes.md says how")
    program = tmp_path / "recipe.py"
    program.write_text(STEPS.sub(FEW, block.text), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MINARI_DATASETS_PATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, program], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
