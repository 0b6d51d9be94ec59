"""Vectors of four doubles for the innermost loops of the solver, as instructions of LLVM.

The four contacts of a batch share no body, so one instruction may do all four. LLVM does not find
that out by itself (a contact reads and writes bodies that an index names), so the loop is written
with vectors: a function with the decorator `vector_loop` writes the instructions at the place where
a kernel calls it. LLVM turns them into what the processor has: AVX, or two halves of SSE2 or NEON.
No instruction carries a fast-math flag and none is fused, so the bits are those of the scalar
formula.

Where nothing is compiled (``NUMBA_DISABLE_JIT``) there are no vectors; every such loop has a scalar
twin with the same bits.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

from multicor_cli.engine.jit.arrays import CHUNK
from multicor_cli.engine.jit.compile import IS_COMPILING, cgutils, intrinsic, types

LANES = 4
"""Numbers in a vector."""

BATCHES = CHUNK // LANES
"""Vectors of a chunk."""

HAS_VECTORS = IS_COMPILING
"""Whether vector loops can be called."""

_DOUBLE, _INT, _LONG = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_UNDEFINED = ir.Constant(_VECTOR, ir.Undefined)
_SIGN = 1 << 63  # bit of a double
# Lanes of two vectors, side by side
_EVEN, _ODD, _LOW, _HIGH = (0, 4, 2, 6), (1, 5, 3, 7), (0, 1, 4, 5), (2, 3, 6, 7)


class Vector:
    """Four doubles; arithmetic writes an instruction and gives the vector that it will produce."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder = builder
        self.value = value

    def __add__(self, other: Vector) -> Vector:
        return Vector(self.builder, self.builder.fadd(self.value, other.value))

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.builder, self.builder.fsub(self.value, other.value))

    def __mul__(self, other: Vector) -> Vector:
        return Vector(self.builder, self.builder.fmul(self.value, other.value))

    def __truediv__(self, other: Vector) -> Vector:
        return Vector(self.builder, self.builder.fdiv(self.value, other.value))

    def __neg__(self) -> Vector:
        return Vector(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> Vector:
        return self._call("fabs")

    def _call(self, operation: str) -> Vector:
        name = f"llvm.{operation}.v{LANES}f64"
        module = self.builder.module
        function = module.globals.get(name) or ir.Function(
            module, ir.FunctionType(_VECTOR, [_VECTOR]), name
        )
        return Vector(self.builder, self.builder.call(function, [self.value]))

    def larger(self, other: Vector) -> Vector:
        """As ``a if a > b else b``, lane by lane."""
        return self.where(">", other, self, other)

    def smaller(self, other: Vector) -> Vector:
        """As ``a if a < b else b``, lane by lane."""
        return self.where("<", other, self, other)

    def flipped(self, lanes: Sequence[bool]) -> Vector:
        """With the other sign in some lanes."""
        integers = ir.VectorType(_LONG, LANES)
        signs = ir.Constant(integers, [_SIGN if is_flipped else 0 for is_flipped in lanes])
        bits = self.builder.xor(self.builder.bitcast(self.value, integers), signs)
        return Vector(self.builder, self.builder.bitcast(bits, _VECTOR))

    def root(self) -> Vector:
        """Square root, correctly rounded."""
        return self._call("sqrt")

    def floor(self) -> Vector:
        """Largest integers that are not above."""
        return self._call("floor")

    def where(self, comparison: str, other: Vector, then: Vector, otherwise: Vector) -> Vector:
        """``then`` in the lanes where the comparison with ``other`` holds."""
        is_so = self.builder.fcmp_ordered(comparison, self.value, other.value)
        return Vector(self.builder, self.builder.select(is_so, then.value, otherwise.value))


class Writer:
    """Writes a vector loop. Indices are LLVM values of 64 bits, arrays pointers to element 0."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder

    def number(self, value: float) -> Vector:
        return Vector(self.builder, ir.Constant(_VECTOR, [value] * LANES))

    def spread(self, scalar: ir.Value) -> Vector:
        """A number known at run time, in all lanes."""
        single = self.builder.insert_element(_UNDEFINED, scalar, _INT(0))
        return Vector(self.builder, self._shuffle(single, _UNDEFINED, (0,) * LANES))

    def lane(self, vector: Vector, number: int) -> Vector:
        """A number of a vector in all lanes."""
        return Vector(self.builder, self._shuffle(vector.value, _UNDEFINED, (number,) * LANES))

    def masked(self, vector: Vector, lanes: Sequence[bool]) -> Vector:
        """A vector with zeros in all but some lanes."""
        ones = ir.Constant(_VECTOR, [1.0 if is_kept else 0.0 for is_kept in lanes])
        return vector * Vector(self.builder, ones)

    def whole(self, value: int) -> ir.Value:
        """A whole number, as an index."""
        return _LONG(value)

    def times(self, index: ir.Value, factor: int) -> ir.Value:
        return self.builder.mul(index, _LONG(factor))

    def offset(self, index: ir.Value, by: int) -> ir.Value:
        return self.builder.add(index, _LONG(by))

    def load(self, array: ir.Value, at: ir.Value) -> Vector:
        return Vector(self.builder, self.builder.load(self._place(array, at), align=8))

    def store(self, array: ir.Value, at: ir.Value, vector: Vector) -> None:
        self.builder.store(vector.value, self._place(array, at), align=8)

    def block(self, array: ir.Value, number: ir.Value, rows: int, *which: int) -> list[Vector]:
        """Some rows of a block of ``rows`` rows of four."""
        start = self.times(number, LANES * rows)
        return [self.load(array, self.offset(start, LANES * row)) for row in which]

    def fill(self, array: ir.Value, number: ir.Value, rows: int, what: dict[int, Vector]) -> None:
        """Write some rows of a block of ``rows`` rows of four."""
        start = self.times(number, LANES * rows)
        for row, vector in what.items():
            self.store(array, self.offset(start, LANES * row), vector)

    def indices(self, array: ir.Value, at: ir.Value) -> list[ir.Value]:
        """Four 32-bit integers of an array from ``at`` on."""
        places = (self.builder.gep(array, [self.offset(at, lane)]) for lane in range(LANES))
        return [self.builder.zext(self.builder.load(place, align=4), _LONG) for place in places]

    def everywhere(self, array: ir.Value, at: ir.Value) -> Vector:
        """An element of an array in all lanes."""
        return self.spread(self.builder.load(self.builder.gep(array, [at]), align=8))

    def transpose(self, rows: Sequence[Vector]) -> list[Vector]:
        """Four vectors: of the first lanes of the given ones, of their second lanes, and so on."""
        r0, r1, r2, r3 = (row.value for row in rows)
        t0, t1 = self._shuffle(r0, r2, _LOW), self._shuffle(r1, r3, _LOW)
        t2, t3 = self._shuffle(r0, r2, _HIGH), self._shuffle(r1, r3, _HIGH)
        columns = (t0, t1, _EVEN), (t0, t1, _ODD), (t2, t3, _EVEN), (t2, t3, _ODD)
        return [Vector(self.builder, self._shuffle(*column)) for column in columns]

    def apart(self, low: Vector, high: Vector) -> tuple[Vector, Vector]:
        """Numbers in even and in odd places of eight."""
        even, odd = (
            Vector(self.builder, self._shuffle(low.value, high.value, lanes))
            for lanes in ((0, 2, 4, 6), (1, 3, 5, 7))
        )
        return even, odd

    def together(self, even: Vector, odd: Vector) -> tuple[Vector, Vector]:
        """The inverse of `apart`."""
        low, high = (
            Vector(self.builder, self._shuffle(even.value, odd.value, lanes))
            for lanes in ((0, 4, 1, 5), (2, 6, 3, 7))
        )
        return low, high

    def keep(self, vectors: Iterable[Vector]) -> Kept:
        return Kept(self.builder, vectors)

    @contextmanager
    def each(self, first: ir.Value, last: ir.Value) -> Iterator[ir.Value]:
        """Context of a loop over ``first … last-1``; it gives the index."""
        with cgutils.for_range_slice(self.builder, first, last, _LONG(1), _LONG) as (index, _):
            yield index

    def if_any(self, first: ir.Value, last: ir.Value) -> Any:
        """Context of what is done only if ``first < last``."""
        return self.builder.if_then(self.builder.icmp_signed("<", first, last))

    def total(self, vector: Vector) -> ir.Value:
        """Sum of the lanes in order, from 0."""
        result: ir.Value = _DOUBLE(0.0)
        for lane in range(LANES):
            result = self.builder.fadd(
                result, self.builder.extract_element(vector.value, _INT(lane))
            )
        return result

    def largest(self, vector: Vector) -> ir.Value:
        """Largest of the lanes and 0."""
        result: ir.Value = _DOUBLE(0.0)
        for lane in range(LANES):
            element = self.builder.extract_element(vector.value, _INT(lane))
            result = self.builder.select(
                self.builder.fcmp_ordered(">", element, result), element, result
            )
        return result

    def _place(self, array: ir.Value, at: ir.Value) -> ir.Value:
        return self.builder.bitcast(self.builder.gep(array, [at]), _VECTOR.as_pointer())

    def _shuffle(self, a: ir.Value, b: ir.Value, lanes: Sequence[int]) -> ir.Value:
        return self.builder.shuffle_vector(
            a, b, ir.Constant(ir.VectorType(_INT, LANES), list(lanes))
        )


class Kept:
    """Vectors that live through a loop."""

    def __init__(self, builder: ir.IRBuilder, vectors: Iterable[Vector]) -> None:
        self._builder = builder
        self._places = [cgutils.alloca_once_value(builder, vector.value) for vector in vectors]

    def get(self) -> list[Vector]:
        return [Vector(self._builder, self._builder.load(place)) for place in self._places]

    def put(self, vectors: Iterable[Vector]) -> None:
        for vector, place in zip(vectors, self._places, strict=True):
            self._builder.store(vector.value, place)


def vector_loop(results: int) -> Callable[[Callable[..., Sequence[ir.Value]]], Callable[..., Any]]:
    """Decorator: a function that writes a loop becomes one of numbers and flat arrays for kernels.

    The function gets a `Writer` and the arguments, arrays as pointers to their first element, and
    returns ``results`` numbers: what a kernel gets from the call (one by itself, several as a
    tuple).
    """

    def decorate(write: Callable[..., Sequence[ir.Value]]) -> Callable[..., Any]:
        def loop(typingctx: Any, *arguments: types.Type) -> tuple[Any, Callable[..., ir.Value]]:
            del typingctx
            kinds = [_kind(argument) for argument in arguments]
            back = (
                types.none
                if results == 0
                else types.float64
                if results == 1
                else types.UniTuple(types.float64, results)
            )

            def generate(
                context: Any, builder: ir.IRBuilder, sig: Any, values: Sequence[ir.Value]
            ) -> ir.Value:
                given = [
                    context.make_array(kind)(context, builder, value=value).data
                    if isinstance(kind, types.Array)
                    else value
                    for kind, value in zip(sig.args, values, strict=True)
                ]
                made = write(Writer(builder), *given)
                if results == 0:
                    return context.get_dummy_value()
                return (
                    made[0] if results == 1 else context.make_tuple(builder, sig.return_type, made)
                )

            return back(*kinds), generate

        # Numba asks how many arguments there are; the writer has one in place of the first.
        loop.__signature__ = inspect.signature(write)  # type: ignore[attr-defined]
        return intrinsic(functools.update_wrapper(loop, write))  # type: ignore[no-any-return]

    return decorate


def _kind(argument: types.Type) -> types.Type:
    """Type of an argument: arrays as they are, integers with 64 bits, other numbers as doubles."""
    if isinstance(argument, types.Array):
        return argument
    return (
        types.int64 if isinstance(argument, types.Integer | types.IntegerLiteral) else types.float64
    )
