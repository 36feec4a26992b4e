"""Explicit SIMD in numba kernels: sixteen numbers at once, so that the speed does not hang on a compiler's heuristics.

`Lanes` is an LLVM vector of 16 float32 or float64. `+ - * /` work between lanes, and with a scalar on the right.
Everything else is a function of this module. LLVM splits the vector into the machine's registers (AVX2: two).
"""

from __future__ import annotations

import math
import operator

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, overload, register_model

from gsac.avatar.draw_rule import ALPHA_LEVELS

WIDTH = 16

_CONTRACT = ("contract", "nsz")


class Lanes(types.Type):
    """Numba type of 16 float32 or float64."""

    def __init__(self, real: types.Float):
        self.real = real
        super().__init__(name=f"Lanes({real})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, lanes):
        super().__init__(manager, lanes, ir.VectorType(_scalar(lanes), WIDTH))


def _scalar(lanes: Lanes):
    return ir.FloatType() if lanes.real == types.float32 else ir.DoubleType()


def _vector(lanes: Lanes):
    return ir.VectorType(_scalar(lanes), WIDTH)


def _spread(builder, value, lanes: Lanes):
    seed = builder.insert_element(ir.Constant(_vector(lanes), ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(seed, ir.Constant(_vector(lanes), ir.Undefined), mask)


def _all(lanes: Lanes, value: float):
    return ir.Constant(_vector(lanes), [value] * WIDTH)


def _fused(builder, lanes: Lanes, a, b, c):
    """a * b + c, one instruction where the machine has it."""
    return builder.fadd(builder.fmul(a, b, flags=_CONTRACT), c, flags=_CONTRACT)


def _address(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, value=array).data
    lanes = Lanes(array_type.dtype)
    return builder.bitcast(builder.gep(data, [index]), ir.PointerType(_vector(lanes)))


@intrinsic
def load(typingctx, array, index):
    """Lanes from `array[index : index + 16]` of a contiguous array; no bounds check."""
    lanes = Lanes(array.dtype)

    def code(context, builder, signature, arguments):
        pointer = _address(context, builder, array, arguments[0], arguments[1])
        return builder.load(pointer, align=array.dtype.bitwidth // 8)

    return lanes(array, types.uintp), code


@intrinsic
def store(typingctx, array, index, value):
    """Writes lanes to `array[index : index + 16]`."""

    def code(context, builder, signature, arguments):
        pointer = _address(context, builder, array, arguments[0], arguments[1])
        builder.store(arguments[2], pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.uintp, value), code


@intrinsic
def spread(typingctx, value):
    """The same number in all lanes."""
    lanes = Lanes(value)

    def code(context, builder, signature, arguments):
        return _spread(builder, arguments[0], lanes)

    return lanes(value), code


@intrinsic
def below_or_equal(typingctx, a, bound, yes, no):
    """Lane by lane `yes if a <= bound else no`; bound, yes and no may be scalars of the same precision."""
    parts = [p if isinstance(p, Lanes) else a.real for p in (bound, yes, no)]

    def code(context, builder, signature, arguments):
        wide = [v if isinstance(p, Lanes) else _spread(builder, v, a) for p, v in zip(parts, arguments[1:], strict=True)]
        return builder.select(builder.fcmp_ordered("<=", arguments[0], wide[0]), wide[1], wide[2])

    return a(a, *parts), code


@intrinsic
def total(typingctx, a):
    """Sum of the lanes, in one fixed order."""

    def code(context, builder, signature, arguments):
        value, width = arguments[0], WIDTH
        while width > 1:
            width //= 2
            low = ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(width)))
            high = ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(width, 2 * width)))
            blank = ir.Constant(value.type, ir.Undefined)
            value = builder.fadd(builder.shuffle_vector(value, blank, low), builder.shuffle_vector(value, blank, high))
        return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    return a.real(a), code


@intrinsic
def store_totals(typingctx, array, index, a, b, c, d, e, f, g, h):
    """Writes the eight lanes' sums to `array[index : index + 8]`; three times fewer instructions than eight `total`."""
    half = WIDTH // 2

    def code(context, builder, signature, arguments):
        def pick(x, y, mask):
            return builder.shuffle_vector(x, y, ir.Constant(ir.VectorType(ir.IntType(32), half), mask))

        def neighbours(x, y):
            return builder.fadd(pick(x, y, [0, 2, 8, 10, 4, 6, 12, 14]), pick(x, y, [1, 3, 9, 11, 5, 7, 13, 15]))

        blank = ir.Constant(_vector(a), ir.Undefined)
        folded = [builder.fadd(pick(v, blank, list(range(half))), pick(v, blank, list(range(half, WIDTH))))
                  for v in arguments[2:]]
        pairs = [neighbours(folded[i], folded[i + 1]) for i in (0, 2, 4, 6)]
        left, right = neighbours(pairs[0], pairs[1]), neighbours(pairs[2], pairs[3])
        sums = builder.fadd(pick(left, right, [0, 1, 2, 3, 8, 9, 10, 11]), pick(left, right, [4, 5, 6, 7, 12, 13, 14, 15]))
        data = context.make_array(array)(context, builder, value=arguments[0]).data
        pointer = builder.bitcast(builder.gep(data, [arguments[1]]), ir.PointerType(sums.type))
        builder.store(sums, pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.uintp, a, b, c, d, e, f, g, h), code


@intrinsic
def any_above(typingctx, a, bound):
    """Whether any lane is above a scalar."""

    def code(context, builder, signature, arguments):
        bits = builder.fcmp_ordered(">", arguments[0], _spread(builder, arguments[1], a))
        return builder.icmp_unsigned("!=", builder.bitcast(bits, ir.IntType(WIDTH)), ir.Constant(ir.IntType(WIDTH), 0))

    return types.boolean(a, a.real), code


@intrinsic
def lowest_bit(typingctx, mask):
    """Position of the lowest set bit of a uint64 that is not zero."""

    def code(context, builder, signature, arguments):
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), code


def _exp_coefficients(degree: int, end: float) -> list[float]:
    """exp(-x) on 0..end as a polynomial of x, lowest power first: interpolation at Chebyshev points."""
    points = [end / 2 * (1 + math.cos(math.pi * (i + 0.5) / (degree + 1))) for i in range(degree + 1)]
    newton = [math.exp(-x) for x in points]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            newton[i] = (newton[i] - newton[i - 1]) / (points[i] - points[i - level])
    coefficients = [newton[degree]]
    for i in range(degree - 1, -1, -1):
        shifted = [0.0, *coefficients]
        for j, c in enumerate(coefficients):
            shifted[j] -= points[i] * c
        shifted[0] += newton[i]
        coefficients = shifted
    return coefficients


@intrinsic
def falloff(typingctx, s):
    """exp(-s) for s in 0..ln ALPHA_LEVELS; relative error 7e-7 in float32, 1e-14 in float64; other s give any number."""
    coefficients = _exp_coefficients(5 if s.real == types.float32 else 13, math.log(ALPHA_LEVELS) / 8)

    def code(context, builder, signature, arguments):
        x = builder.fmul(arguments[0], _all(s, 0.125))
        value = _all(s, coefficients[-1])
        for c in reversed(coefficients[:-1]):
            value = _fused(builder, s, value, x, _all(s, c))
        for _ in range(3):
            value = builder.fmul(value, value)
        return value

    return s(s), code


def _binary(operation: str):
    @intrinsic
    def apply(typingctx, a, b):
        other = b if isinstance(b, Lanes) else a.real

        def code(context, builder, signature, arguments):
            right = arguments[1] if isinstance(b, Lanes) else _spread(builder, arguments[1], a)
            return getattr(builder, operation)(arguments[0], right, flags=_CONTRACT)

        return a(a, other), code

    return apply


_add, _subtract, _multiply, _divide = (_binary(name) for name in ("fadd", "fsub", "fmul", "fdiv"))


@overload(operator.add)
def _lanes_add(a, b):
    if isinstance(a, Lanes):
        return lambda a, b: _add(a, b)


@overload(operator.sub)
def _lanes_subtract(a, b):
    if isinstance(a, Lanes):
        return lambda a, b: _subtract(a, b)


@overload(operator.mul)
def _lanes_multiply(a, b):
    if isinstance(a, Lanes):
        return lambda a, b: _multiply(a, b)


@overload(operator.truediv)
def _lanes_divide(a, b):
    if isinstance(a, Lanes):
        return lambda a, b: _divide(a, b)


__all__ = ["WIDTH", "Lanes", "any_above", "below_or_equal", "falloff", "load", "lowest_bit", "spread", "store",
           "store_totals", "total"]
