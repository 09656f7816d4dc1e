"""Fields by name: `paper:1`, `standard/train:0-99`, a JSON file or a directory of them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path

from ferguson_gym.runtime.arrays import truncate_repr
from ferguson_gym.world.field import Field, from_json
from ferguson_gym.world.paper_fields import paper_field
from ferguson_gym.world.suites import SPLITS, SUITES, suite_field

_NAMED = re.compile(r"(?P<family>[^:]*):(?P<first>[0-9]{1,40})(-(?P<last>[0-9]{1,40}))?")

GRAMMAR = (
    "fields are named paper:1 to paper:4, SUITE/SPLIT:SEED or SUITE/SPLIT:A-B (B included; "
    f"suites {', '.join(SUITES)}; splits {', '.join(SPLITS)}), "
    "or by the path of a JSON file or of a directory of such files"
)
"""The grammar of field names in one sentence, for help texts and errors."""
_PATH = 300
"""Characters of a path that an error shows."""


def get_fields(spec: str) -> Iterator[Field]:
    """The fields that a specification names, one at a time.

    Invalid specifications raise at once, before the first field is drawn; files are read one by
    one as the iterator advances.

    Raises:
        ValueError: an unknown suite, split, file or an empty range.

    Example:
        >>> [field.name for field in get_fields("paper:1-4")]
        ['paper:1', 'paper:2', 'paper:3', 'paper:4']
    """
    if not spec:
        raise ValueError(f"a field needs a name: {GRAMMAR}")
    path = Path(spec)
    try:
        files = _in(path) if path.is_dir() else [path] if path.is_file() else None
    except OSError:  # a name too long for a file
        files = None
    if files == []:
        deeper = next(iter(sorted(path.glob("*/*.json"))), None)
        hint = "" if deeper is None else f"; there are some one level deeper, in {deeper.parent}"
        raise ValueError(f"no JSON files in directory {truncate_repr(spec, _PATH)}{hint}")
    if files is not None:
        return map(from_json, files)
    match = _NAMED.fullmatch(spec)
    if match is None:
        if path.suffix == ".json":
            raise ValueError(f"no such field file: {truncate_repr(spec, _PATH)}")
        raise ValueError(f"unknown field {truncate_repr(spec)}: {GRAMMAR}")
    first = int(match["first"])
    last = int(match["last"] or first)
    if first > last:
        raise ValueError(f"empty range in {truncate_repr(spec)}: {first} is above {last}")
    if match["family"] == "paper":
        draw = paper_field
    else:
        suite, slash, split = match["family"].partition("/")
        if not slash:
            raise ValueError(f"unknown field {truncate_repr(spec)}: {GRAMMAR}")
        draw = partial(suite_field, suite, split)
    lowest = draw(first)
    if last > first:
        draw(last)  # the ends show whether the whole range is known
    return chain([lowest], map(draw, range(first + 1, last + 1)))


def _in(directory: Path) -> list[Path]:
    """The JSON files of a directory; hidden files, such as half-written ones, are skipped."""
    return sorted(path for path in directory.glob("*.json") if not path.name.startswith("."))


def family(spec: str) -> tuple[str, range]:
    """Family and range of a specification of drawn fields: `FAMILY:n` for each n of the range.

    Such names always stand for the same fields; files may change.

    Raises:
        ValueError: as `get_fields`, or it names files.
    """
    get_fields(spec)
    match = _NAMED.fullmatch(spec)
    if match is None or Path(spec).exists():
        raise ValueError(
            f"{truncate_repr(spec)} is a file, which may change; "
            "need fields of a suite or of the paper"
        )
    first = int(match["first"])
    return match["family"], range(first, int(match["last"] or first) + 1)


def get_field(spec: str) -> Field:
    """The single field that a specification names.

    Raises:
        ValueError: as `get_fields`, or if it names more than one field.

    Example:
        >>> field = get_field("traps/validation:7")
        >>> len(field.obstacles), field.goal.tolist()
        (84, [100.0, 100.0])
    """
    fields = get_fields(spec)
    field = next(fields)
    if next(fields, None) is not None:
        raise ValueError(f"{truncate_repr(spec)} names more than one field")
    return field


def as_field(given: object) -> Field:
    """A field, by value or by name.

    Raises:
        ValueError: neither, or an unknown name.
    """
    field = get_field(given) if isinstance(given, str) else given
    if not isinstance(field, Field):
        raise ValueError(f"a field must be a Field or the name of one, got {type(given).__name__}")
    return field
