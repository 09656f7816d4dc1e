"""Numba's compiler behind typed names, so that strict type checks see through it.

Numba caches machine code beside the module and invalidates it only when that module's file
changes, although kernels call kernels and take constants of other files. Each kernel is therefore
cached under a name with a digest of all files that some kernel can reach, so that no change leaves
stale machine code in use.
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

    Modules are identified by their dotted names, since folders may hold files of the same name. A
    package's `__init__` counts where a name is imported from it.
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
    """Compile a function to machine code on first use and cache it beside its module.

    Arithmetic is IEEE (no fast-math: certificates depend on it) and a division by
    zero gives an infinity or NaN instead of an exception.
    """
    return _jit(function)


def compiled_without_lock(function: F) -> F:
    """As `compiled`, without the interpreter's lock: other Python threads can run meanwhile."""
    return _jit(function, nogil=True)


def compiled_in_place(function: F) -> F:
    """As `compiled`, but inlined into every caller: for functions that many arguments make slow."""
    return _jit(function, inline="always")


def _jit(function: F, **options: Any) -> F:
    function.__qualname__ = f"{function.__qualname__}-{_digest()}"
    return cast(F, numba.njit(cache=True, error_model="numpy", **options)(function))


@intrinsic
def _unowned(_: Any, value: Any) -> Any:
    """An array, or a tuple of arrays and others, without owners of memory.

    No references are counted when such arrays are sliced; the counting is atomic and takes a
    quarter of a step's time. The caller must keep the memory alive.
    """

    def strip(context: Any, builder: Any, kind: Any, given: Any) -> Any:
        if isinstance(kind, types.BaseTuple):
            members: Any = kind
            parts = [
                strip(context, builder, member, builder.extract_value(given, i))
                for i, member in enumerate(members)
            ]
            return context.make_tuple(builder, kind, parts)
        if not isinstance(kind, types.Array):
            return given
        struct = context.make_array(kind)(context, builder, given)
        for member in ("meminfo", "parent"):
            old = getattr(struct, member)
            setattr(struct, member, ir.Constant(old.type, None))
        return struct._getvalue()

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return strip(context, builder, value, arguments[0])

    return value(value), generate


@intrinsic
def _prefetch(_: Any, array: Any, byte: Any) -> Any:
    """Load a cache line of an array, from this byte on, without waiting for it."""

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
