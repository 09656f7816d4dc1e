"""Pages that are made of docstrings.

A comment in a page names what stands in its place: `<!-- docstring: MODULE.NAME -->` a docstring
that is written in Markdown, `<!-- folders: PACKAGE -->` an overview of a package, folder by folder.
Each folder with modules gets a page of its own in reference/generated, with all their public names.
"""

import ast
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from sphinx.application import Sphinx

PACKAGES = ("ferguson_gym", "planners", "agents")
GENERATED = Path("reference") / "generated"
_MARK = re.compile(r"^<!-- (docstring|folders): ([\w.]+) -->$", re.MULTILINE)
_RAISES = re.compile(r"^Raises:\n((?:    .*\n?)+)", re.MULTILINE)


def docstring(name: str) -> str:
    """The docstring of a public name, with its section of errors as Markdown too."""
    module, _, attribute = name.rpartition(".")
    text = inspect.getdoc(getattr(importlib.import_module(module), attribute))
    if text is None:
        raise ValueError(f"{name} has no docstring")

    def errors(match: re.Match[str]) -> str:
        rows = (line.strip().partition(": ") for line in match[1].splitlines())
        return "## Raises\n" + "".join(f"- `{error}`: {when}\n" for error, _, when in rows)

    return _RAISES.sub(errors, text)


def folders(package: str) -> str:
    """A package's folders, each with its docstring, a link to its page and its modules."""
    parts = []
    pages = []
    for name, place in _folders(package):
        pages.append(f"{GENERATED.name}/{name}")
        parts.append(
            f"\n## [{name}]({GENERATED.name}/{name}.md)\n\n{_docstring(place / '__init__.py')}\n\n"
            + _table(name, place, f"{GENERATED.name}/{name}.md")
        )
    listed = "\n".join(pages)
    return "".join(parts) + f"\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"


def write_pages(app: Sphinx) -> None:
    """Write a page for each folder, and remove pages of folders that no longer exist."""
    target = Path(app.srcdir) / GENERATED
    target.mkdir(exist_ok=True)
    written = set()
    for package in PACKAGES:
        for name, place in _folders(package):
            page = target / f"{name}.md"
            text = f"# {name}\n\n{_docstring(place / '__init__.py')}\n\n{_table(name, place)}"
            for module in _modules(place):
                title = f"{name}.{module.stem}"
                text += f"\n## {title}\n\n```{{eval-rst}}\n.. automodule:: {title}\n```\n"
            # an unchanged page keeps its time, so that it is not read again
            if not page.exists() or page.read_text(encoding="utf-8") != text:
                page.write_text(text, encoding="utf-8")
            written.add(page)
    for page in set(target.iterdir()) - written:
        page.unlink()


def _folders(package: str) -> Iterator[tuple[str, Path]]:
    """Names and places of a package's folders with modules, the package itself first."""
    root = Path(importlib.import_module(package).__path__[0])
    for init in sorted(root.rglob("__init__.py"), key=lambda init: init.parent.parts):
        if _modules(init.parent):
            yield ".".join((package, *init.parent.relative_to(root).parts)), init.parent


def _modules(place: Path) -> list[Path]:
    return [path for path in sorted(place.glob("*.py")) if path.name != "__init__.py"]


def _docstring(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if text is None:
        raise ValueError(f"{path} has no docstring")
    return text


def _table(folder: str, place: Path, page: str = "") -> str:
    """The modules of a folder with the first line of each one's docstring."""
    rows = "".join(
        f"| [`{path.stem}`]({page}#{re.sub('[._]', '-', f'{folder}.{path.stem}')}) "
        f"| {_docstring(path).partition(chr(10))[0]} |\n"
        for path in _modules(place)
    )
    return f"| module | what it is |\n| --- | --- |\n{rows}"


def fill_in(app: Sphinx, page: str, source: list[str]) -> None:
    """Put text in the place of each mark of a page."""
    makers = {"docstring": docstring, "folders": folders}
    source[0] = _MARK.sub(lambda match: makers[match[1]](match[2]), source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the generated pages first, and fill in every other page when it is read."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", fill_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
