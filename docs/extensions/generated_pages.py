"""Pages that are made of docstrings: a comment in a page says where they go.

`<!-- docstring: MODULE.NAME -->` stands for a docstring that is written in Markdown,
`<!-- modules: PACKAGE -->` for the reference of all modules of a package.
"""

import ast
import importlib
import inspect
import re
from pathlib import Path

from sphinx.application import Sphinx

_MARK = re.compile(r"^<!-- (docstring|modules): ([\w.]+) -->$", re.MULTILINE)
_RAISES = re.compile(r"^Raises:\n((?:    .*\n?)+)", re.MULTILINE)


def docstring(name: str) -> str:
    """The docstring of something, its last section as Markdown too."""
    module, _, attribute = name.rpartition(".")
    text = inspect.getdoc(getattr(importlib.import_module(module), attribute))
    if text is None:
        raise ValueError(f"{name} has no docstring")

    def errors(match: re.Match[str]) -> str:
        rows = (line.strip().partition(": ") for line in match[1].splitlines())
        return "## Raises\n" + "".join(f"- `{error}`: {when}\n" for error, _, when in rows)

    return _RAISES.sub(errors, text)


def modules(package: str) -> str:
    """A table of a package's modules, then what each of them offers."""
    root = Path(importlib.import_module(package).__path__[0])
    rows, parts = [], []
    for path in sorted(root.rglob("*.py")):
        if path.name == "__init__.py":
            continue
        name = ".".join(path.relative_to(root).with_suffix("").parts)
        source = path.read_text(encoding="utf-8")
        line = (ast.get_docstring(ast.parse(source)) or "").splitlines()[0]
        rows.append(
            f"| [`{name}`](#{package.replace('_', '-')}-{re.sub('[._]', '-', name)}) | {line} |\n"
        )
        parts.append(
            f"\n## {package}.{name}\n\n```{{eval-rst}}\n.. automodule:: {package}.{name}\n```\n"
        )
    return "| module | what it is |\n| --- | --- |\n" + "".join(rows) + "".join(parts)


def fill_in(app: Sphinx, page: str, source: list[str]) -> None:
    """Put text in the place of each mark of a page."""
    makers = {"docstring": docstring, "modules": modules}
    source[0] = _MARK.sub(lambda match: makers[match[1]](match[2]), source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill in every page when it is read."""
    app.connect("source-read", fill_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
