"""Numba's compiler behind typed names, so that strict type checks see through it.

Numba caches machine code beside the module and watches the file of the function it holds, no
other; yet kernels call kernels and take constants of other files. Each is therefore cached under
a name that carries a digest of every file that some kernel can reach: whatever changes, nothing
stale is run.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])
T = TypeVar("T")

PACKAGES = ("ferguson_gym", "planners", "agents")
"""Packages with compiled functions."""
_IMPORT = re.compile(r"^\s*(?:from|import) .*", re.MULTILINE)
_WORD = re.compile(r"\w+")


def digest(root: Path) -> str:
    """Short digest of the source files below a directory that kernels can reach."""
    state = hashlib.sha256()
    for path in reachable(root):
        state.update(path.name.encode())
        state.update(path.read_bytes())
    return state.hexdigest()[:12]


def reachable(root: Path) -> list[Path]:
    """Files with kernels, and all that they import, directly or not; none that matters less.

    A line that imports is taken to name every file whose name is a word of it: rather one
    too many.
    """
    files = [path for package in PACKAGES for path in sorted((root / package).glob("*.py"))]
    names = {path.stem for path in files}
    imports = {}
    for path in files:
        lines = _IMPORT.findall(path.read_text(encoding="utf-8"))
        imports[path] = names.intersection(_WORD.findall(" ".join(lines)))
    wanted: set[str] = set()
    more = {path.stem for path in files if "compilation" in imports[path]}
    while more - wanted:
        wanted |= more
        more = {name for path in files if path.stem in wanted for name in imports[path]}
    return [path for path in files if path.stem in wanted]


@cache
def _digest() -> str:
    return digest(Path(__file__).parent.parent)


def compiled(function: F) -> F:
    """Compile to machine code on first use and cache it beside the module.

    Arithmetic is IEEE (no fast-math: certificates depend on it) and a division by
    zero gives an infinity or NaN instead of an exception.
    """
    return _jit(function)


def compiled_without_lock(function: F) -> F:
    """As `compiled`; other Python threads run meanwhile."""
    return _jit(function, nogil=True)


def compiled_in_place(function: F) -> F:
    """As `compiled`, but copied into its callers: for functions that take much by value."""
    return _jit(function, inline="always")


def _jit(function: F, **options: Any) -> F:
    function.__qualname__ = f"{function.__qualname__}-{_digest()}"
    return cast(F, numba.njit(cache=True, error_model="numpy", **options)(function))


@intrinsic
def _borrowed(_: Any, array: Any) -> Any:
    """An array without its owner: no reference is counted when it is sliced.

    The counting is atomic and takes a quarter of a step's time. Whoever borrows must see to it
    that the array lives on.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        struct = context.make_array(array)(context, builder, arguments[0])
        for member in ("meminfo", "parent"):
            old = getattr(struct, member)
            setattr(struct, member, ir.Constant(old.type, None))
        return struct._getvalue()

    return array(array), generate


@intrinsic
def _prefetch(_: Any, array: Any, byte: Any) -> Any:
    """Have a line of an array's memory brought near, from this byte on, while work goes on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        struct = context.make_array(array)(context, builder, arguments[0])
        start = builder.bitcast(struct.data, ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [start.type, number, number, number])
        prefetch = cgutils.get_or_insert_function(  # type: ignore[no-untyped-call]
            builder.module, kind, "llvm.prefetch.p0"
        )
        to_read, soon, data = number(0), number(3), number(1)
        builder.call(prefetch, [builder.gep(start, [arguments[1]]), to_read, soon, data])
        return context.get_dummy_value()

    return types.none(array, types.int64), generate


# typed as they are called from compiled functions
borrowed = cast("Callable[[T], T]", _borrowed)
prefetch = cast("Callable[[NDArray[Any], int], None]", _prefetch)
