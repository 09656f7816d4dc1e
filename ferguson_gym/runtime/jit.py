"""Typed wrappers of Numba's decorators, so that mypy can check compiled functions.

Numba caches machine code beside the module and invalidates it only when that module's file changes,
although a kernel may depend on functions and constants of other files. Each kernel is therefore
cached under a name with a digest of its file and of all that this file imports, directly or not, so
that no change leaves stale machine code in use and a change recompiles only what depends on it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from ferguson_gym.runtime import compilation
from ferguson_gym.runtime.cache_directory import with_cache

F = TypeVar("F", bound=Callable[..., object])
T = TypeVar("T")

PACKAGES = ("ferguson_gym", "planners", "agents")
"""Packages with compiled functions."""
_IMPORT = re.compile(r"^[ \t]*(?:from ([\w.]+) )?import (\([^)]*\)|.*)", re.MULTILINE)
_ALIAS = re.compile(r"[\w.]+(?: +as +\w+)?")


class Sources:
    """Source files below a directory, each read once, and which of them import which."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._read: dict[str, tuple[bytes, set[str]]] = {}
        self._digests: dict[str, str] = {}

    def digest(self, module: str) -> str:
        """Short digest of a module, given by its dotted name, and of all that it reaches."""
        if module not in self._digests:
            state = hashlib.sha256()
            for name in sorted(self.reachable(module)):
                state.update(name.encode() + self._content(name)[0])
            self._digests[module] = state.hexdigest()[:12]
        return self._digests[module]

    def reachable(self, module: str) -> set[str]:
        """A module and those of `PACKAGES` that it imports, directly or not, by dotted names.

        A package's `__init__` counts where a name is imported from it.
        """
        wanted: set[str] = set()
        more = {module}
        while more:
            wanted |= more
            more = {name for one in more for name in self._content(one)[1]} - wanted
        return wanted

    def file(self, module: str) -> Path | None:
        """The file of a module or package; None for one that is not of `PACKAGES`."""
        path = self._root.joinpath(*module.split("."))
        candidates = (path.with_suffix(".py"), path / "__init__.py")
        if module.partition(".")[0] not in PACKAGES:
            return None
        return next((file for file in candidates if file.is_file()), None)

    def _content(self, module: str) -> tuple[bytes, set[str]]:
        if module not in self._read:
            file = self.file(module)
            assert file is not None
            source = file.read_bytes()
            self._read[module] = source, self._imported(source.decode())
        return self._read[module]

    def _imported(self, source: str) -> set[str]:
        found: set[str] = set()
        for module, names in _IMPORT.findall(source):
            for alias in _ALIAS.findall(re.sub("#.*", "", names)):
                name = alias.partition(" ")[0]
                full = f"{module}.{name}" if module else name
                found.add(full if self.file(full) else module)
        return {name for name in found if self.file(name)}


_SOURCES = Sources(Path(__file__).parents[__name__.count(".")])


compilation.watch(PACKAGES)


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
    function.__qualname__ = f"{function.__qualname__}-{_SOURCES.digest(function.__module__)}"
    # nothing calls kernels from C
    options |= {"error_model": "numpy", "no_cfunc_wrapper": True}
    return with_cache(
        lambda cache: cast(F, numba.njit(cache=cache, **options)(function)),
        function.__code__.co_filename,
    )


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
