"""The example notebook does what it shows: its cells run in order, with the outputs saved in it.

Jupyter is not needed: cells run in one namespace, and pictures are compared by their captions,
since flights of a numerical optimiser agree on other machines but for rounding.
"""

import ast
import contextlib
import io
import json
import re
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

from tests.support.places import ROOT

NOTEBOOK = json.loads((ROOT / "examples" / "pictures.ipynb").read_text(encoding="utf-8"))
CELLS = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
_TITLE = re.compile(r"<title>(.*?)</title>")


def run(source: str, names: dict[str, Any]) -> tuple[str, Any]:
    """What a cell prints, and the value of an expression at its end."""
    tree = ast.parse(source)
    value = None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    return printed.getvalue(), value


def saved(cell: dict[str, Any]) -> tuple[str, list[str]]:
    """The printed text and the SVG pictures that are saved with a cell."""
    text = "".join("".join(output.get("text", "")) for output in cell["outputs"])
    data = [output["data"] for output in cell["outputs"] if "data" in output]
    return text, ["".join(one["image/svg+xml"]) for one in data]


def test_cells_run_in_order_with_the_saved_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    plt.switch_backend("agg")
    names: dict[str, Any] = {}
    with mpl.rc_context():
        for cell in CELLS:
            printed, value = run("".join(cell["source"]), names)
            text, pictures = saved(cell)
            assert printed == text
            if value is not None:
                assert _TITLE.findall(value._repr_svg_()) == _TITLE.findall("".join(pictures))
    plt.close("all")


def test_every_kind_of_picture_is_saved() -> None:
    assert [cell["execution_count"] for cell in CELLS] == list(range(1, len(CELLS) + 1))
    pictures = [picture for cell in CELLS for picture in saved(cell)[1]]
    assert len(pictures) == 6
    assert sum("animateMotion" in picture for picture in pictures) == 1
    assert "cut into an obstacle" in pictures[-1]  # in mode human, as updated in the next cell
    assert not any(output["output_type"] == "error" for cell in CELLS for output in cell["outputs"])


@pytest.mark.slow
def test_the_notebook_runs_in_jupyter() -> None:
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = nbformat.reads(json.dumps(NOTEBOOK), as_version=4)
    nbclient.NotebookClient(notebook, timeout=600).execute(cwd=str(ROOT))
    for cell, before in zip(
        [c for c in notebook.cells if c.cell_type == "code"], CELLS, strict=True
    ):
        (text, pictures), (text_before, pictures_before) = saved(cell), saved(before)
        assert text == text_before
        assert [_TITLE.findall(one) for one in pictures] == [
            _TITLE.findall(one) for one in pictures_before
        ]
