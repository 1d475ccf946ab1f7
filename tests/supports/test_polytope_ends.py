"""Refinement ends, also for sets so small or thin that support points are less exact than it hopes."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope

Array = NDArray[np.float64]


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
