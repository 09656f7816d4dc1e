"""Numba's compiler behind a typed decorator, so that strict type checks see through it.

Numba's cache watches the file of the function it holds, and no other: a compiled function may
call only compiled functions of its own file, or a change elsewhere would not reach it. A test
holds this.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile to machine code on first use and cache it beside the module.

    Arithmetic is IEEE (no fast-math: certificates depend on it) and a division by
    zero gives an infinity or NaN instead of an exception.
    """
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))
