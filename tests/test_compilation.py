"""Compiled functions keep to their own file, since Numba's cache watches no other."""

import ast
from pathlib import Path

import pytest

PACKAGES = ("ferguson_gym", "planners", "agents")
ROOT = Path(__file__).parent.parent
TREES = {
    f"{package}.{path.stem}": ast.parse(path.read_text())
    for package in PACKAGES
    for path in (ROOT / package).glob("*.py")
}


def compiled_functions(tree: ast.Module) -> list[ast.FunctionDef]:
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(
            isinstance(mark, ast.Name) and mark.id == "compiled" for mark in node.decorator_list
        )
    ]


WITH_KERNELS = [name for name, tree in TREES.items() if compiled_functions(tree)]


def test_there_are_compiled_functions() -> None:
    assert "ferguson_gym.bernstein" in WITH_KERNELS


@pytest.mark.parametrize("module", WITH_KERNELS)
def test_compiled_functions_use_nothing_imported_from_the_project(module: str) -> None:
    tree = TREES[module]
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGES)
        for alias in node.names
    }
    for function in compiled_functions(tree):
        names = {
            node.id
            for body in function.body
            for node in ast.walk(body)
            if isinstance(node, ast.Name)
        }
        assert not names & imported, function.name
