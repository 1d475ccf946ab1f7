"""The nearest point of constrained zonotopes and other sets, beside linear programs by HiGHS."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import ConstrainedZonotope, Intersection, Orthotope, Parallelotope, Zonotope
from lsu_mesh.supports.nearest_point import nearest_point, nearest_to_center


def least_distance(body: ConstrainedZonotope, m: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """min over ξ, x of ``max |x − m|/q``."""
    c, G, A, b = body.arrays
    (n, g), q = G.shape, 0.5 * (upper - lower)
    equal = np.block([[A, np.zeros((len(b), n + 1))], [G, -np.eye(n), np.zeros((n, 1))]])
    less = np.block([[np.zeros((n, g)), np.eye(n), -q[:, None]], [np.zeros((n, g)), -np.eye(n), -q[:, None]]])
    limits = [*[(-1.0, 1.0)] * g, *zip(lower, upper, strict=True), (0.0, None)]
    cost = np.r_[np.zeros(g + n), 1.0]
    return float(linprog(cost, less, np.r_[m, -m], A_eq=equal, b_eq=np.r_[b, -c], bounds=limits).fun)


@pytest.mark.parametrize("seed", range(40))
def test_the_nearest_point_of_a_constrained_zonotope(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, g = 1 + seed % 5, int(rng.integers(6, 20))
    m = int(rng.integers(0, 5))
    G, A, xi = rng.normal(size=(n, g)), rng.normal(size=(m, g)), rng.uniform(-1, 1, g)
    body = ConstrainedZonotope(rng.normal(size=n), G, A, A @ xi)
    low, high = body.bounds()
    lower, upper = low + 0.05 * (high - low), high - 0.05 * (high - low)
    target = rng.uniform(lower, upper)
    point = nearest_point(body, target, lower, upper)
    assert body.contains(point)
    assert ((lower <= point) & (point <= upper)).all()
    distance = (np.abs(point - target) / (0.5 * (upper - lower))).max()
    assert distance == pytest.approx(least_distance(body, target, lower, upper), abs=2e-5)


def test_boxes_bundles_and_zonotopes() -> None:
    box, body = Orthotope([-1.0, -1.0], [1.0, 1.0]), Parallelotope([0.0, 0.0], [[1.0, 1.0], [1.0, -1.0]])
    lower, upper = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    assert nearest_point(box, [3.0, 0.5], lower, upper).tolist() == [1.0, 0.5]
    # |x + y| ≤ 2, |x − y| ≤ 2 hold in the box: the diamond is cut by it, and the corner of the box is left
    corner = nearest_point(Intersection([body, box]), [3.0, 0.9], lower, upper)
    assert corner == pytest.approx([1.0, 0.9])
    diamond = Parallelotope([0.0, 0.0], [[0.5, 0.5], [0.5, -0.5]])
    assert nearest_point(diamond, [0.9, 0.9], lower, upper) == pytest.approx([0.5, 0.5], abs=1e-8)
    assert nearest_point(Zonotope([0.0, 0.0], diamond.generators), [0.9, 0.9], lower, upper) == pytest.approx(
        [0.5, 0.5], abs=1e-6
    )


def test_a_coordinate_without_width_holds_the_others() -> None:
    """x = y in the set, and the box fixes x: the point is on the diagonal there, not beside it."""
    body = ConstrainedZonotope([0.0, 0.0], [[1.0], [1.0]], np.zeros((0, 1)), [])
    point = nearest_point(body, [0.25, -1.0], np.array([0.25, -1.0]), np.array([0.25, 1.0]))
    assert point == pytest.approx([0.25, 0.25], abs=1e-9)
    assert point[0] == 0.25


def test_method_2_of_p2023_ends_inside() -> None:
    body = ConstrainedZonotope([0.0, 0.0], np.eye(2), [[1.0, 1.0]], [1.5])
    point = nearest_to_center(body, *body.bounds())
    assert point == pytest.approx([0.75, 0.75], abs=1e-6)
    assert body.contains(point)
