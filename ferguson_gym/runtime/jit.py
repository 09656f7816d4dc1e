"""Numba's compiler behind typed names, so that strict type checks see through it.

Numba caches machine code beside the module and watches the file of the function it holds, no
other; yet kernels call kernels and take constants of other files. Each is therefore cached under
a name that carries a digest of every file that some kernel can reach: whatever changes, nothing
stale is run.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Collection
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
_IMPORT = re.compile(r"^[ \t]*(?:from ([\w.]+) )?import (\([^)]*\)|.*)", re.MULTILINE)
_ALIAS = re.compile(r"[\w.]+(?: +as +\w+)?")


def digest(root: Path) -> str:
    """Short digest of the source files below a directory that kernels can reach."""
    state = hashlib.sha256()
    for path in reachable(root):
        state.update(path.relative_to(root).as_posix().encode())
        state.update(path.read_bytes())
    return state.hexdigest()[:12]


def reachable(root: Path) -> list[Path]:
    """Files with kernels, and all modules that they import, directly or not.

    A module is known by its dotted name, so that modules of the same file name in several folders
    are told apart. A package's `__init__` counts where a name is imported from it.
    """
    files = {
        _dotted(path.relative_to(root)): path
        for package in PACKAGES
        for path in sorted((root / package).rglob("*.py"))
    }
    imports = {
        name: _imported(path.read_text(encoding="utf-8"), files.keys())
        for name, path in files.items()
    }
    wanted: set[str] = set()
    more = {name for name in files if __name__ in imports[name]}
    while more - wanted:
        wanted |= more
        more = {imported for name in wanted for imported in imports[name]}
    return [path for name, path in files.items() if name in wanted]


def _dotted(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def _imported(source: str, modules: Collection[str]) -> set[str]:
    """Those of some modules that a source imports, or imports a name from."""
    found: set[str] = set()
    for module, names in _IMPORT.findall(source):
        for alias in _ALIAS.findall(re.sub("#.*", "", names)):
            name = alias.partition(" ")[0]
            full = f"{module}.{name}" if module else name
            found.add(full if full in modules else module)
    return found.intersection(modules)


@cache
def _digest() -> str:
    return digest(Path(__file__).parents[__name__.count(".")])


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
def _unowned(_: Any, array: Any) -> Any:
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
unowned = cast("Callable[[T], T]", _unowned)
prefetch = cast("Callable[[NDArray[Any], int], None]", _prefetch)
