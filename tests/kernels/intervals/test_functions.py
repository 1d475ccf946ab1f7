"""Every function of intervals holds the exact values, computed with 200 bits, and loses at most four units."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import mpmath
import numba
import numpy as np
import pytest

from lsu_mesh.kernels.intervals import arithmetic, functions

Bounds = tuple[float, float]
ONE = {
    "exponential": (mpmath.exp, -700.0, 700.0),
    "logarithm": (mpmath.log, 0.0, 1e300),
    "sine": (mpmath.sin, -1e18, 1e18),
    "cosine": (mpmath.cos, -1e18, 1e18),
    "tangent": (mpmath.tan, -1e18, 1e18),
    "arctangent": (mpmath.atan, -1e300, 1e300),
    "arcsine": (mpmath.asin, -1.0, 1.0),
    "arccosine": (mpmath.acos, -1.0, 1.0),
    "hyperbolic_sine": (mpmath.sinh, -700.0, 700.0),
    "hyperbolic_cosine": (mpmath.cosh, -700.0, 700.0),
    "hyperbolic_tangent": (mpmath.tanh, -1e3, 1e3),
    "square": (lambda x: x * x, -1e150, 1e150),
    "square_root": (mpmath.sqrt, 0.0, 1e300),
    "absolute": (abs, -1e300, 1e300),
}
TWO = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply_intervals": lambda x, y: x * y,
    "divide_intervals": lambda x, y: x / y,
    "minimum": min,
    "maximum": max,
}


def of_one(name: str) -> Callable[[float, float], Bounds]:
    function = getattr(functions, name, None) or getattr(arithmetic, name)

    @numba.njit  # type: ignore[untyped-decorator]
    def call(a: float, b: float) -> Bounds:
        return function(a, b)  # type: ignore[no-any-return]

    return call  # type: ignore[no-any-return]


def of_two(name: str) -> Callable[[float, float, float, float], Bounds]:
    function = getattr(arithmetic, name)

    @numba.njit  # type: ignore[untyped-decorator]
    def call(a: float, b: float, c: float, d: float) -> Bounds:
        return function(a, b, c, d)  # type: ignore[no-any-return]

    return call  # type: ignore[no-any-return]


@numba.njit  # type: ignore[untyped-decorator]
def angle(a: float, b: float, c: float, d: float, any_branch: bool) -> Bounds:
    return functions.angle(a, b, c, d, any_branch)


@numba.njit  # type: ignore[untyped-decorator]
def integer_power(a: float, b: float, n: int) -> Bounds:
    return arithmetic.integer_power(a, b, n)


def numbers(rng: np.random.Generator, low: float, high: float, count: int) -> Iterator[float]:
    """Doubles of every size, ends, whole numbers and what lies next to multiples of π / 2 among them."""
    yielded = 0
    for value in itertools.chain([low, high, 0.0, 1.0, -1.0, 0.5, -0.0], (k * math.pi / 2 for k in range(1, 9))):
        if low <= value <= high:
            yield value
            yielded += 1
    while yielded < count:
        kind = rng.integers(4)
        value = float(rng.uniform(max(low, -10.0), min(high, 10.0)))
        if kind == 1:
            value = float(np.ldexp(rng.uniform(-1, 1), rng.integers(-300, 400)))
        elif kind == 2:
            value = float(rng.integers(1, 10**6)) * math.pi / 2
        elif kind == 3:
            value = 1.0 + float(np.ldexp(rng.uniform(-1, 1), rng.integers(-52, 0)))
        if low <= value <= high:
            yield value
            yielded += 1


def assert_tight(found: Bounds, exact: mpmath.mpf, what: object) -> None:
    low, high = found
    assert mpmath.mpf(low) <= exact <= mpmath.mpf(high), (what, found, exact)
    size = max(abs(low), abs(high))
    assert high - low <= 4 * math.ulp(size), (what, found, exact)


def check_one(name: str, rng: np.random.Generator, count: int) -> None:
    exact, low, high = ONE[name]
    call = of_one(name)
    previous: float | None = None
    with mpmath.workprec(1200 if name in ("sine", "cosine", "tangent") else 200):
        for x in numbers(rng, low, high, count):
            if name == "logarithm" and x <= 0.0:
                continue
            at = exact(mpmath.mpf(x))
            assert_tight(call(x, x), at, (name, x))
            if previous is not None:
                a, b = min(x, previous), max(x, previous)
                if b - a > 3.0 and rng.random() < 0.7:
                    b = a + float(rng.uniform(0, 3.0))
                bounds = call(a, b)
                if not math.isnan(bounds[0]):
                    for share in (0.0, 0.3, 0.77, 1.0):
                        inside = min(max(a + share * (b - a), a), b)
                        value = exact(mpmath.mpf(inside))
                        assert bounds[0] <= value <= bounds[1], (name, a, b, inside, bounds, value)
                else:
                    assert name == "tangent"
            previous = x


@pytest.mark.parametrize("name", ONE)
def test_a_function_of_an_interval_holds_the_exact_values(name: str) -> None:
    check_one(name, np.random.default_rng(1), 2_000)


@pytest.mark.soak
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize("name", ONE)
def test_a_function_of_an_interval_holds_ten_million_exact_values(name: str) -> None:
    check_one(name, np.random.default_rng(2), 10_000_000)


@pytest.mark.parametrize("name", TWO)
def test_arithmetic_of_intervals_holds_the_exact_values(name: str) -> None:
    rng, call = np.random.default_rng(3), of_two(name)
    values = list(numbers(rng, -1e300, 1e300, 3_000))
    with mpmath.workprec(2400):
        for x, y, dx, dy in zip(values, reversed(values), values[7:], values[13:], strict=False):
            if name == "divide_intervals" and y == 0.0:
                assert math.isnan(call(x, x, y, y)[0])
                continue
            exact = TWO[name](mpmath.mpf(x), mpmath.mpf(y))
            found = call(x, x, y, y)
            if math.isnan(found[0]):
                assert abs(exact) > 1e300
            elif abs(exact) > 1e-300 or exact == 0:
                assert_tight(found, exact, (name, x, y))
            else:
                assert found[0] <= exact <= found[1]
            a, b, c, d = min(x, dx), max(x, dx), min(y, dy), max(y, dy)
            bounds = call(a, b, c, d)
            if math.isnan(bounds[0]):
                continue
            for u, v in itertools.product((a, a / 2 + b / 2, b), (c, c / 2 + d / 2, d)):
                value = TWO[name](mpmath.mpf(u), mpmath.mpf(v))
                assert bounds[0] <= value <= bounds[1], (name, a, b, c, d)


def test_a_quotient_is_enclosed_wherever_the_divisor_misses_zero() -> None:
    call = of_two("divide_intervals")
    assert call(-1.0, 1.0, 2.0, 4.0) == (-0.5, 0.5)
    assert call(1.0, 2.0, -4.0, -2.0) == (-1.0, -0.25)
    assert math.isnan(call(1.0, 2.0, 0.0, 1.0)[0])
    assert math.isnan(call(1.0, 2.0, -1.0, 1.0)[1])


def test_powers_hold_the_exact_values() -> None:
    rng = np.random.default_rng(4)
    with mpmath.workprec(8000):
        for n in (0, 1, 2, 3, 5, 8, 17, 64, -1, -2, -3):
            for a in numbers(rng, -40.0, 40.0, 100):
                b = a + float(rng.exponential())
                found = integer_power(a, b, n)
                if n < 0 and a <= 0.0 <= b:
                    assert math.isnan(found[0])
                    continue
                if math.isnan(found[0]):
                    assert max(abs(a), abs(b)) ** abs(n) > 1e300 or min(abs(a), abs(b)) < 1e-100
                    continue
                for x in (a, 0.25 * a + 0.75 * b, b):
                    assert found[0] <= mpmath.mpf(x) ** n <= found[1], (a, b, n, x, found)


def test_an_angle_holds_every_point_of_the_box_on_any_branch() -> None:
    rng = np.random.default_rng(5)
    enclosed = crossed = 0
    with mpmath.workprec(200):
        for _ in range(4_000):
            y, x = rng.normal(size=2) * 10.0 ** rng.integers(-3, 3, 2)
            wide = rng.exponential(size=2) * 10.0 ** rng.integers(-12, 1, 2)
            a, b, c, d = float(y), float(y + wide[0]), float(x), float(x + wide[1])
            plain, any_branch = angle(a, b, c, d, False), angle(a, b, c, d, True)
            holds_origin = a <= 0.0 <= b and c <= 0.0 <= d
            assert math.isnan(any_branch[0]) == holds_origin
            crossed += math.isnan(plain[0]) and not holds_origin
            for v, u in itertools.product((a, (a + b) / 2, b), (c, (c + d) / 2, d)):
                if math.isnan(any_branch[0]):
                    continue
                value = mpmath.atan2(mpmath.mpf(v), mpmath.mpf(u))
                turned = value + 2 * mpmath.pi if value < any_branch[0] - 1 else value
                assert any_branch[0] <= turned <= any_branch[1], (a, b, c, d, v, u)
                if not math.isnan(plain[0]):
                    enclosed += 1
                    assert plain[0] <= value <= plain[1], (a, b, c, d, v, u)
            point = angle(a, a, c, c, False)
            assert_tight(point, mpmath.atan2(mpmath.mpf(a), mpmath.mpf(c)), (a, c))
    assert enclosed > 1_000
    assert crossed > 10


def test_what_leaves_the_domain_is_not_enclosed() -> None:
    for name, a, b in (
        ("square_root", -1e-300, 1.0), ("logarithm", 0.0, 1.0), ("arcsine", 0.5, 1.0000000000000002),
        ("arccosine", -1.0000000000000002, 0.0), ("exponential", 0.0, 710.0), ("tangent", 1.5, 1.6),
        ("hyperbolic_sine", 0.0, 711.0), ("square", 1e200, 1e200),
    ):  # fmt: skip
        assert all(map(math.isnan, of_one(name)(a, b))), name
    for name in ONE:
        if name not in ("absolute",):
            assert all(map(math.isnan, of_one(name)(math.nan, math.nan))), name


def test_tops_and_bottoms_of_a_wave_are_found() -> None:
    sine, cosine = of_one("sine"), of_one("cosine")
    assert sine(1.5, 1.6)[1] == 1.0
    assert sine(4.7, 4.8)[0] == -1.0
    assert sine(0.0, 7.0) == (-1.0, 1.0)
    assert cosine(-0.1, 0.1)[1] == 1.0
    assert cosine(3.0, 3.2)[0] == -1.0
    assert cosine(1e17, 1e17 + 3.0e1) == (-1.0, 1.0)
    assert sine(0.0, 0.0) == (0.0, 0.0)
