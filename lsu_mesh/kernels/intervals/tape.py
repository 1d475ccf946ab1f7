"""Evaluation of a tape: one operation per row, each on results of earlier rows, all in intervals rounded outward."""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.array_types import Array, Integers, Vector
from lsu_mesh.kernels.intervals.arithmetic import (
    absolute,
    add,
    divide_intervals,
    integer_power,
    maximum,
    minimum,
    multiply_intervals,
    sign,
    square,
    square_root,
    subtract,
)
from lsu_mesh.kernels.intervals.functions import (
    angle,
    arccosine,
    arcsine,
    arctangent,
    cosine,
    exponential,
    hyperbolic_cosine,
    hyperbolic_sine,
    hyperbolic_tangent,
    logarithm,
    sine,
    tangent,
)
from lsu_mesh.kernels.intervals.operations import (
    ABS,
    ACOS,
    ADD,
    ASIN,
    ATAN,
    ATAN2,
    ATAN2_ANY,
    CONSTANT,
    COS,
    COSH,
    DIVIDE,
    EXP,
    LOG,
    MAX,
    MIN,
    MULTIPLY,
    NEGATE,
    POWER,
    SIGN,
    SIN,
    SINH,
    SQRT,
    SQUARE,
    SUBTRACT,
    TAN,
    TANH,
    VARIABLE,
)
from lsu_mesh.kernels.runtime.compile import inner


class Tape(NamedTuple):
    """Operations (k,), their arguments as rows (k,), (k,), and bounds (k, 2) of those that are constants.

    ``second`` of a power is its exponent, ``first`` of a variable its number.
    """

    operations: Integers
    first: Integers
    second: Integers
    constants: Array


@inner
def evaluate(tape: Tape, lower: Vector, upper: Vector, count: int, low: Vector, high: Vector) -> None:
    """Write bounds of the first ``count`` rows over the box [lower, upper] of the variables to low, high (k,)."""
    for i in range(count):
        operation, j, k = tape.operations[i], tape.first[i], tape.second[i]
        if operation == CONSTANT:
            low[i], high[i] = tape.constants[i, 0], tape.constants[i, 1]
            continue
        if operation == VARIABLE:
            low[i], high[i] = lower[j], upper[j]
            continue
        a, b = low[j], high[j]
        if operation == ADD:
            low[i], high[i] = add(a, b, low[k], high[k])
        elif operation == SUBTRACT:
            low[i], high[i] = subtract(a, b, low[k], high[k])
        elif operation == MULTIPLY:
            low[i], high[i] = multiply_intervals(a, b, low[k], high[k])
        elif operation == DIVIDE:
            low[i], high[i] = divide_intervals(a, b, low[k], high[k])
        elif operation == NEGATE:
            low[i], high[i] = -b, -a
        elif operation == SQUARE:
            low[i], high[i] = square(a, b)
        elif operation == POWER:
            low[i], high[i] = integer_power(a, b, k)
        elif operation == SQRT:
            low[i], high[i] = square_root(a, b)
        elif operation == SIN:
            low[i], high[i] = sine(a, b)
        elif operation == COS:
            low[i], high[i] = cosine(a, b)
        elif operation in (ATAN2, ATAN2_ANY):
            low[i], high[i] = angle(a, b, low[k], high[k], operation == ATAN2_ANY)
        else:
            low[i], high[i] = rare(operation, a, b, low[k], high[k])


@inner
def rare(operation: int, a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """The operations that few models use."""
    if operation == EXP:
        return exponential(a, b)
    if operation == LOG:
        return logarithm(a, b)
    if operation == TAN:
        return tangent(a, b)
    if operation == ATAN:
        return arctangent(a, b)
    if operation == ASIN:
        return arcsine(a, b)
    if operation == ACOS:
        return arccosine(a, b)
    if operation == ABS:
        return absolute(a, b)
    if operation == SIGN:
        return sign(a, b)
    if operation == SINH:
        return hyperbolic_sine(a, b)
    if operation == COSH:
        return hyperbolic_cosine(a, b)
    if operation == TANH:
        return hyperbolic_tangent(a, b)
    if operation == MIN:
        return minimum(a, b, c, d)
    assert operation == MAX
    return maximum(a, b, c, d)
