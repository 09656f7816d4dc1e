"""Matrix products in single precision, compiled: alike for every row.

A network's answer must not depend on what else it is asked at the same time, or flights would
depend on how many are in the air. Libraries of matrix products sum in another order for another
number of rows. Here each element is a sum in the order of its terms, each added with one rounding,
whichever rows and columns are worked on together: so it is the same in any batch, and on any
processor.

Weights are packed in panels of `PANEL` columns, and `ROWS` rows share what is read of a panel:
what the compiler makes of plain loops takes five times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from agents.models.inference.activations import Single
from ferguson_gym.runtime.jit import compiled

PANEL = 32
"""Columns of a panel."""
ROWS = 4
"""Rows that share what is read of it."""
_LANES = 16
"""Numbers of a vector instruction, or of several where the processor's are shorter."""

_NUMBER = ir.IntType(64)
_VECTOR = ir.VectorType(ir.FloatType(), _LANES)
_NOTHING = ir.Constant(_VECTOR, ir.Undefined)
_FIRST = ir.IntType(32)(0)
_ALL_THE_FIRST = ir.Constant(ir.VectorType(ir.IntType(32), _LANES), [0] * _LANES)


def _tile(rows: int) -> Any:
    """Adds the product of so many rows and a panel to sums, which are in registers meanwhile."""

    @intrinsic
    def tile(_: Any, given: Any, first: Any, weights: Any, panel: Any, sums: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            def array(k: int) -> tuple[Any, Any]:
                struct = context.make_array(signature.args[k])(context, builder, arguments[k])
                shape = cgutils.unpack_tuple(builder, struct.shape)  # type: ignore[no-untyped-call]
                return struct.data, shape

            def vectors(data: Any) -> list[Any]:
                """Those of a panel's width that begin here."""
                places = [builder.gep(data, [_NUMBER(k)]) for k in range(0, PANEL, _LANES)]
                return [builder.bitcast(place, _VECTOR.as_pointer()) for place in places]

            (inputs, (_, stride)), (panels, (_, depth, _)) = array(0), array(2)
            totals, (_, width) = array(4)
            column = builder.mul(arguments[3], _NUMBER(PANEL))
            factors = builder.gep(panels, [builder.mul(column, depth)])
            which = [builder.add(arguments[1], _NUMBER(row)) for row in range(rows)]
            lines = [builder.gep(inputs, [builder.mul(row, stride)]) for row in which]
            targets = [
                vectors(builder.gep(totals, [builder.add(builder.mul(row, width), column)]))
                for row in which
            ]
            fused = cgutils.get_or_insert_function(  # type: ignore[no-untyped-call]
                builder.module,
                ir.FunctionType(_VECTOR, [_VECTOR] * 3),
                f"llvm.fma.v{_LANES}f32",
            )
            # variables, of which the compiler makes registers
            held = [
                [cgutils.alloca_once(builder, _VECTOR) for _ in one]  # type: ignore[no-untyped-call]
                for one in targets
            ]
            for target, registers in zip(targets, held, strict=True):
                for place, register in zip(target, registers, strict=True):
                    builder.store(builder.load(place, align=4), register)
            with cgutils.for_range(builder, depth) as loop:
                row = builder.gep(factors, [builder.mul(loop.index, _NUMBER(PANEL))])
                wide = [builder.load(place, align=4) for place in vectors(row)]
                for line, registers in zip(lines, held, strict=True):
                    one = builder.load(builder.gep(line, [loop.index]))
                    one = builder.insert_element(_NOTHING, one, _FIRST)
                    one = builder.shuffle_vector(one, _NOTHING, _ALL_THE_FIRST)
                    for factor, register in zip(wide, registers, strict=True):
                        total = builder.load(register)
                        builder.store(builder.call(fused, [one, factor, total]), register)
            for target, registers in zip(targets, held, strict=True):
                for place, register in zip(target, registers, strict=True):
                    builder.store(builder.load(register), place, align=4)
            return context.get_dummy_value()

        return types.none(given, types.int64, weights, types.int64, sums), generate

    return tile


_Tile: TypeAlias = Callable[[Single, int, Single, int, Single], None]
_several, _single = cast(_Tile, _tile(ROWS)), cast(_Tile, _tile(1))


def pack(matrix: Single) -> Single:
    """A matrix (out, in), as torch has it, in panels (n, in, PANEL), the last columns zero."""
    wide, deep = matrix.shape
    panels = -(-wide // PANEL)
    padded = np.zeros((panels * PANEL, deep), np.float32)
    padded[:wide] = matrix
    return np.ascontiguousarray(padded.reshape(panels, PANEL, deep).transpose(0, 2, 1))


def pad(vector: Single) -> Single:
    """A vector with zeros behind it, as long as the panels that go with it are wide."""
    padded = np.zeros(-(-len(vector) // PANEL) * PANEL, np.float32)
    padded[: len(vector)] = vector
    return padded


@compiled
def add_product(given: Single, weights: Single, sums: Single) -> None:
    """Add a product to sums.

    Args:
        given: (n, in) or larger; of what is larger nothing is read.
        weights: panels (p, in, PANEL).
        sums: (n, p PANEL).
    """
    number = len(sums)
    assert len(given) >= number
    assert given.shape[1] >= weights.shape[1]
    assert sums.shape[1] == len(weights) * PANEL
    for panel in range(len(weights)):
        row = 0
        while row + ROWS <= number:
            _several(given, row, weights, panel, sums)
            row += ROWS
        while row < number:
            _single(given, row, weights, panel, sums)
            row += 1


@compiled
def affine(given: Single, weights: Single, bias: Single) -> Single:
    """A layer of a network: (n, p PANEL), where `weights` has p panels and `bias` fits them."""
    sums = np.empty((len(given), len(bias)), np.float32)
    for row in range(len(given)):
        for column in range(len(bias)):
            sums[row, column] = bias[column]
    add_product(given, weights, sums)
    return sums
