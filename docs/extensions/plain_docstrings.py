"""Docstrings as they are written here, for Sphinx: plain text, code in backticks, Google's style.

Sphinx's own extension for Google's style is not loaded: it takes what stands before a colon in the
docstring of an attribute for its type. Citations, AUTHORS (YEAR), become links to references.md.
"""

import re
import unicodedata

from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, GoogleDocstring

_SPECIAL = re.compile(r"[\\*|]|_(?!\w)")
"""What would be markup in reStructuredText."""
_HEADING = re.compile(r"^## ", re.MULTILINE)
"""Marks a docstring that is written in Markdown; it has a page of its own."""
_CITATION = re.compile(
    r"\b([A-ZŞ][\w-]+)((?:(?:,| &|,? and)\s+[A-ZŞ][\w-]+)*|\s+et al\.)\s+\((\d{4})\)"
)
"""Names of authors, and the year in brackets."""
_VALUES = ("attribute", "data", "property")


def as_restructured_text(text: str) -> str:
    """The same text, in which only what stands in backticks is marked up."""
    if _HEADING.search(text):
        return f"{text.partition(chr(10))[0]}\n\nSpecified in :doc:`/environment`.\n"
    written = ""
    for index, part in enumerate(text.split("`")):
        if index % 2:
            written += f"``{part}``"
            continue
        if written and part[:1].isalnum():
            written += "\\ "  # ends the code that a word goes on from
        written += _CITATION.sub(_linked, _SPECIAL.sub(r"\\\g<0>", part))
    return written


def _linked(match: re.Match[str]) -> str:
    """A citation as a link to its label in references.md: the first author and the year."""
    author = unicodedata.normalize("NFKD", match[1]).encode("ascii", "ignore").decode().lower()
    return f":ref:`{' '.join(match[0].split())} <{author}-{match[3]}>`"


def convert(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Convert a docstring in place."""
    text = as_restructured_text("\n".join(lines))
    kind = "function" if what in _VALUES else what
    lines[:] = GoogleDocstring(text, Config(), app, kind, name, thing, options).lines()


def setup(app: Sphinx) -> dict[str, bool]:
    """Have every docstring converted that the reference is made of."""
    app.connect("autodoc-process-docstring", convert)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
