"""Linear enclosures hold the function at every point of the box, computed with 200 bits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from expressions import NAMES, TEXTS, made

from lsu_mesh.kernels.intervals.enclosure import FIRST, NOT_ENCLOSED, SECOND, Linear, enclose
from lsu_mesh.nonlinear.functions import affine, compiled
from lsu_mesh.nonlinear.graph import Graph


def enclosed(graph: Graph, node: int, lower: np.ndarray, upper: np.ndarray, center: np.ndarray) -> Linear:
    result = Linear(np.zeros((1, 3)), np.zeros(1), np.zeros(1), np.zeros(1, dtype=np.int64))
    enclose(compiled(graph, [node], [0, 1, 2]), lower, upper, center, result)
    return result


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("half", [1e-9, 1e-3, 0.1, 0.5])
def test_the_enclosure_holds_every_point(text: str, half: float) -> None:
    rng = np.random.default_rng(1)
    graph, node = made(text)
    for _ in range(6):
        center = np.array([1.25, 2.5, 0.3]) + rng.uniform(-0.2, 0.2, 3)
        widths = half * rng.uniform(0.0, 1.0, 3)
        lower, upper = center - widths, center + widths
        at = lower + rng.uniform(0, 1, 3) * (upper - lower)
        at = np.clip(at, lower, upper)
        found = enclosed(graph, node, lower, upper, at)
        assert found.order[0] != NOT_ENCLOSED
        for share in [*np.eye(3), np.zeros(3), np.ones(3), *rng.uniform(0, 1, (10, 3))]:
            z = np.clip(lower + share * (upper - lower), lower, upper)
            with mpmath.workprec(200):
                exact = TEXTS[text](mpmath, *map(mpmath.mpf, z))
                pairs = zip(found.slopes[0], z, at, strict=True)
                plane = sum((mpmath.mpf(m) * (mpmath.mpf(a) - mpmath.mpf(b)) for m, a, b in pairs), mpmath.mpf(0))
                assert plane + mpmath.mpf(found.low[0]) <= exact <= plane + mpmath.mpf(found.high[0]), z


def test_the_second_order_is_taken_where_it_is_narrower() -> None:
    graph, node = made("x*x")
    at = np.array([1.0, 0.0, 0.0])
    small = enclosed(graph, node, at - 0.1, at + 0.1, at)
    assert small.order[0] == SECOND
    assert small.high[0] - small.low[0] == pytest.approx(0.01)  # one-sided: x² − 1 − 2 (x − 1) is in [0, .01]
    assert small.low[0] == 1.0
    graph, node = made("abs(x)")
    assert enclosed(graph, node, at - 0.1, at + 0.1, at).order[0] == FIRST


def test_a_box_outside_the_domain_is_not_enclosed() -> None:
    for text, low in (("sqrt(x)", -0.1), ("log(x)", 0.0), ("1/x", -1.0), ("asin(x)", -1.5), ("atan2(y, x)", -1.0)):
        graph, node = made(text)
        lower = np.array([low, -1.0, 0.0])
        assert enclosed(graph, node, lower, lower + 1.2, lower + 0.6).order[0] == NOT_ENCLOSED, text


def test_a_gradient_that_is_not_enclosed_leaves_no_linear_step() -> None:
    graph, node = made("sqrt(x)")
    lower = np.array([0.0, 0.0, 0.0])
    assert enclosed(graph, node, lower, lower + 1.0, lower + 0.5).order[0] == NOT_ENCLOSED


def test_affine_rows_are_found_with_their_exact_coefficients() -> None:
    variables = list(range(len(NAMES)))
    for text, row in {
        "x + 0.1*y - th/4 + 2": ([1.0, 0.1, -0.25], 2.0),
        "2*(x - 3) + y - y": ([2.0, 0.0, 0.0], -6.0),
        "-(x + th)": ([-1.0, 0.0, -1.0], 0.0),
        "7": ([0.0, 0.0, 0.0], 7.0),
    }.items():
        graph, node = made(text)
        assert affine(graph, node, variables) == row, text
    for text in ("x*y", "sin(x)", "0.1*(0.1*x)", "pi*x", "x/3 + 1/3", "x*x - x*x + sqrt(2)"):
        graph, node = made(text)
        assert affine(graph, node, variables) is None, text
