"""What is public: every public name is explained, and documents name only what there is.

A module of one of the three packages is public, and so is each name in it without an underscore.
"""

import ast
import importlib
import importlib.util
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.documents import PAGES
from tests.support.places import ROOT

PACKAGES = ("ferguson_gym", "planners", "agents")
DOCUMENTS = PAGES + sorted(
    path
    for pattern in ("*.md", "agents/models/shipped/**/*.md", "benchmarks/*.md")
    for path in ROOT.glob(pattern)
)
_CODE = re.compile(r"`+([^`]+)`+")
_DOTTED = re.compile(rf"(?:{'|'.join(PACKAGES)})(?:\.[A-Za-z_]\w*)+")
_BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
_GENERATED = re.compile(r"^(?::::|\.\. auto\w+::) *(\S+)", re.MULTILINE)
_FILE = re.compile(rf"(?:{'|'.join(PACKAGES)}|tests|docs|benchmarks|examples)/[\w./-]*\w")


def modules() -> list[str]:
    """Names of all modules; importing one may need what is not installed."""
    found = list(PACKAGES)
    for package in PACKAGES:
        prefix = f"{package}."
        found += [info.name for info in pkgutil.walk_packages([str(ROOT / package)], prefix)]
    return found


def source(module: str) -> Path:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_explained(package: str) -> None:
    for module in modules():
        if module.partition(".")[0] != package:
            continue
        tree = ast.parse(source(module).read_text(encoding="utf-8"))
        assert ast.get_docstring(tree), module
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{module}.{node.name}"


def test_names_that_are_not_there_are_found_out() -> None:
    for name in (
        "planners.whole_path.polish.polish",
        "ferguson_gym.world.field.Field.departure",
        "agents.plots.animation.gif",
    ):
        assert has(name), name
    for name in (
        "planners.whole_path.polish.nope",
        "ferguson_gym.world.field.Field.nope",
        "agents.nope.Nope",
    ):
        assert not has(name), name


def exported(module: str) -> list[str] | None:
    """What `__all__` lists, without importing."""
    for node in ast.parse(source(module).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and "__all__" in map(ast.unparse, node.targets):
            names: list[str] = ast.literal_eval(node.value)
            return names
    return None


def test_what_a_module_says_that_it_exports_is_what_it_has() -> None:
    for module in modules():
        names = exported(module)
        if names is None:
            continue
        found = importlib.import_module(module)
        public = {
            name
            for name, value in vars(found).items()
            if not name.startswith("_") and not inspect.ismodule(value)
        }
        assert set(names) == public | {name for name in names if name.startswith("__")}, module
        assert len(names) == len(set(names)), module


def has(name: str) -> bool:
    """Whether a dotted name leads to a module, or to something in one, or an attribute of that."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            spec = importlib.util.find_spec(".".join(parts[:length]))
        except ModuleNotFoundError:  # what should be its package is a module
            spec = None
        if spec is None:
            continue
        assert spec.origin is not None
        return not parts[length:] or _defines(Path(spec.origin), parts[length:])
    return False


def _defines(path: Path, names: list[str]) -> bool:
    """Whether a module's source defines a name, and the class of that name the next."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for depth, name in enumerate(names):
        found = [node for node in _flat(body) if name in _bound(node)]
        if not found:
            return False
        if depth + 1 < len(names):
            if not isinstance(found[0], ast.ClassDef):
                return True  # an object's attributes are not in the source
            body = found[0].body
    return True


def _flat(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    for node in body:
        yield node
        if isinstance(node, ast.If | ast.Try | ast.With):
            yield from _flat(node.body)


def _bound(node: ast.stmt) -> list[str]:
    """Names that a statement binds."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    if isinstance(node, ast.Import | ast.ImportFrom):
        return [alias.asname or alias.name for alias in node.names]
    if isinstance(node, ast.AnnAssign):
        return [ast.unparse(node.target)]
    if isinstance(node, ast.Assign):
        return [
            one.id
            for target in node.targets
            for one in ast.walk(target)
            if isinstance(one, ast.Name)
        ]
    return []


def imports(code: str) -> Iterator[str]:
    """Dotted names that a piece of Python imports from the packages."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def own(name: str) -> bool:
    return name.partition(".")[0] in PACKAGES


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_documents_name_what_there_is(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    named = {name for block in _BLOCK.findall(text) for name in imports(block) if own(name)}
    named |= set(_GENERATED.findall(text))
    inline = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    for code in _CODE.findall(inline):
        named |= {name for name in _DOTTED.findall(code) if not name.endswith(_ENDINGS)}
        for file in _FILE.findall(code) if document.name != "CHANGELOG.md" else []:
            assert (ROOT / file).exists() or has(file.replace("/", ".")), (document.name, file)
    assert not [name for name in sorted(named) if not has(name)], document.name


_ENDINGS = (".py", ".json", ".zip", ".csv", ".yml", ".md", ".npz", ".html")


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_and_comments_name_what_there_is(package: str) -> None:
    unknown = []
    for path in sorted((ROOT / package).rglob("*.py")):
        for code in _CODE.findall(path.read_text(encoding="utf-8")):
            names = [name for name in _DOTTED.findall(code) if not name.endswith(_ENDINGS)]
            unknown += [(path.name, name) for name in names if not has(name)]
    assert not unknown
