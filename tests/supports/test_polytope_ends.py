"""Refinement ends, also for sets so small or thin that support points are less exact than it hopes."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError
from lsu_mesh.supports import polytope
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope


def small_set(rng: np.random.Generator) -> ConstrainedZonotope:
    """A set whose widths differ by many orders of magnitude."""
    g, m = int(rng.integers(4, 16)), int(rng.integers(0, 5))
    scale = 10.0 ** rng.uniform(-10, 0, size=3)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    generators = frame @ np.diag(scale) @ rng.normal(size=(3, g))
    inside = rng.uniform(-1, 1, g)
    A = rng.normal(size=(m, g))
    return ConstrainedZonotope(rng.normal(size=3) * 10, generators, A, A @ inside)


@pytest.fixture
def hurried() -> Iterator[None]:
    """An endless loop in the test becomes a ``TimeoutError``."""

    def interrupt(signum: int, frame: object) -> None:
        raise TimeoutError("refinement does not end")

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("hurried")
def test_refinement_of_small_and_thin_sets_ends() -> None:
    rng = np.random.default_rng(3)
    for _ in range(61):
        drawn = small_set(rng)
        vertices = drawn.vertices()
        direction = rng.normal(size=3)
        widest = np.abs(drawn.generators).sum()
        assert abs((vertices @ direction).max() - farthest(drawn, direction)) <= 1e-6 * widest


def farthest(drawn: ConstrainedZonotope, direction: Array) -> float:
    """max d'x by an independent solver, in variables scaled so that its tolerances mean something."""
    objective = direction @ drawn.generators
    size = np.abs(objective).max()
    equalities = (drawn.A, drawn.b) if drawn.constraint_count else (None, None)
    found = linprog(-objective / size, A_eq=equalities[0], b_eq=equalities[1], bounds=(-1, 1))
    return float(direction @ drawn.center - found.fun * size)


@pytest.mark.usefixtures("hurried")
def test_a_set_of_more_facets_than_are_looked_at_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its vertices are some of the true ones, and its volume is that of the hull."""
    monkeypatch.setattr(polytope, "MAX_FACETS", 2_000)
    rng = np.random.default_rng(1)
    drawn = Zonotope(np.zeros(6), rng.normal(size=(6, 40))).to_constrained_zonotope()
    vertices, direction = drawn.vertices(), rng.normal(size=6)
    assert len(vertices) >= 12
    assert (vertices @ direction).max() <= drawn.support(direction)
    lower, upper = drawn.bounds()
    assert drawn.volume() == pytest.approx(float(np.prod(upper - lower)))


@pytest.mark.usefixtures("hurried")
def test_a_set_in_many_dimensions_is_enumerated_where_it_is_flat() -> None:
    rng = np.random.default_rng(2)
    assert len(Zonotope(np.zeros(30), rng.normal(size=(30, 2))).vertices()) == 4
    flat = np.zeros(30)
    flat[:3] = 1.0
    assert len(Orthotope(-flat, flat).vertices()) == 8


@pytest.mark.parametrize(
    "support",
    [
        Orthotope(-np.ones(30), np.ones(30)),
        Parallelotope(np.zeros(30), np.eye(30)),
        Zonotope(np.zeros(30), np.eye(30)),
        ConstrainedZonotope(np.zeros(30), np.eye(30), np.ones((1, 30)), [0.5]),
    ],
    ids=lambda support: type(support).__name__,
)
@pytest.mark.usefixtures("hurried")
def test_too_many_vertices_are_refused_at_once(support: Support) -> None:
    with pytest.raises(ModelError, match="project it first"):
        support.vertices()


@pytest.mark.parametrize("size", [1e120, 1e-120])
def test_volumes_beyond_double_precision_are_no_error(size: float) -> None:
    """Infinite or zero, without a warning (which would be an error here)."""
    expected = np.inf if size > 1.0 else 0.0
    widths = np.full(3, size)
    box = Orthotope(-widths, widths)
    assert [kind.volume() for kind in (box, box.to_parallelotope(), box.to_constrained_zonotope())] == [expected] * 3
    assert Zonotope(np.zeros(3), size * np.ones((3, 200))).volume() == expected
