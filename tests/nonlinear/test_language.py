"""The language of models: what it says, and what it refuses with row, column and the nearest name."""

from __future__ import annotations

import time

import mpmath
import numpy as np
import pytest
from expressions import TEXTS, made

from lsu_mesh.kernels.intervals.enclosure import Linear, enclose
from lsu_mesh.nonlinear.functions import compiled
from lsu_mesh.nonlinear.language import ExpressionError


def value_at(text: str, point: tuple[float, float, float]) -> tuple[float, float]:
    graph, node = made(text)
    result = Linear(np.zeros((1, 3)), np.zeros(1), np.zeros(1), np.zeros(1, dtype=np.int64))
    at = np.array(point)
    enclose(compiled(graph, [node], [0, 1, 2]), at, at, at, result)
    return float(result.low[0]), float(result.high[0])


@pytest.mark.parametrize("text", TEXTS)
def test_an_expression_means_what_it_says(text: str) -> None:
    point = (1.25, 2.5, 0.3)
    low, high = value_at(text, point)
    with mpmath.workprec(200):
        exact = TEXTS[text](mpmath, *map(mpmath.mpf, point))
        assert mpmath.mpf(low) <= exact <= mpmath.mpf(high)
    assert high - low < 1e-13


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x + thh", "column 5: unknown name 'thh' (did you mean 'th'?)"),
        ("x + speed", "known are pi, th, x, y"),
        ("sine(x)", "unknown function 'sine' (did you mean 'sin'?)"),
        ("atan2(x)", "atan2 takes 2 argument(s), not 1"),
        ("sin(x, y)", "sin takes 1 argument(s), not 2"),
        ("sin", "the function sin needs arguments"),
        ("x.real", "an attribute (a dot) is not part of the language"),
        ("x[0]", "an index in brackets is not part"),
        ("x.__class__", "an attribute"),
        ("__import__('os')", "unknown function '__import__'"),
        ("(lambda: x)()", "cannot be called"),
        ("x if y else th", "a condition is not part"),
        ("x < y", "a comparison is not part"),
        ("x @ y", "only + - * / ** are taken"),
        ("x // y", "only + - * / ** are taken"),
        ("x ** y", "an exponent must be a whole number"),
        ("x ** 1.5", "an exponent must be a whole number"),
        ("x ** 2000", "between"),
        ("x / 0", "division by 0"),
        ("'x'", "is no number"),
        ("True", "is no number"),
        ("1e999", "too large"),
        ("x +", "row 1"),
        ("x\n + * y", "row 2, column"),
        ("x +\n y + zz", "row 2, column 6: unknown name 'zz'"),
        ("x # + y", "no comments"),
        ("", "row 1"),
        ("x, y", "a tuple (a comma)"),
        ("[x for x in y]", "is not part of the language"),
        ("x := 3", "row 1"),
        (3.0, "must be a text"),
        ("\0", "f[0]"),
    ],
)
def test_what_is_not_of_the_language_is_refused_with_a_place(text: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        made(text)
    assert words in str(caught.value)
    assert "f[0]" in str(caught.value)


def test_long_and_deep_expressions_end_within_ten_seconds() -> None:
    for text in (
        "(" * 5_000 + "x" + ")" * 5_000,
        "sin(" * 400 + "x" + ")" * 400,
        "-" * 50_000 + "x",
        "x+" * 60_000 + "x",
    ):
        start = time.process_time()
        with pytest.raises(ExpressionError):
            made(text)
        assert time.process_time() - start < 10.0
    start = time.process_time()
    graph, node = made(" + ".join(f"sin({i}*x)*y" for i in range(2_000)))
    compiled(graph, [node], [0, 1, 2])
    assert time.process_time() - start < 10.0


def test_equal_subexpressions_are_one_node() -> None:
    graph, _ = made("sin(x*y) + sin(x*y)*th")
    assert sum(node.operation == graph.nodes[-2].operation for node in graph.nodes) >= 1
    assert len(graph.nodes) == 7  # x, y, th, x*y, sin, product, sum
