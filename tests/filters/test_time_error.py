"""What an unknown error of a measurement's time costs: exact truth, inputs that jump inside the error."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_course import SECOND, Course, inside

from lsu_mesh import LSUModel, ModelError, Orthotope
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.time_error import state_box, time_widening

ERROR_NS = 40_000_000
FLOW = LSUModel.continuous(
    [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [0.5], [0.1], [[0.0], [1.0]], D=[[0.25]]
)


def drawn(rng: np.random.Generator) -> tuple[Course, HeldInputs, int]:
    """A course under an input that jumps about the moment t, the inputs, and t."""
    t = SECOND
    jumps = sorted({0, *(int(v) for v in rng.integers(t - 2 * ERROR_NS, t + 2 * ERROR_NS, 2))})
    inputs = [float(v) for v in rng.choice([-8.0, 0.0, 8.0], len(jumps))]
    noise = [Fraction(1, 2) * int(v) for v in rng.choice([-1, 1], len(jumps))]
    course = Course(
        [Fraction(0), Fraction(float(rng.uniform(-3, 3)))],
        jumps,
        [Fraction(u) + w for u, w in zip(inputs, noise, strict=True)],
    )
    return course, HeldInputs(jumps, [np.array([u]) for u in inputs]), t


def missed(rng: np.random.Generator, both_sides: bool) -> int:
    """Whether x(s) leaves the box, or y(s) the widened strip, for some moment s within the error of t."""
    course, inputs, t = drawn(rng)
    e = int(rng.integers(1, ERROR_NS))
    x = course.at(t)
    lower, upper = np.array([float(v) for v in x]), np.array([float(v) for v in x])
    lower, upper = np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)
    acting = inputs.hull(t - e, t + e) if both_sides else inputs.at(t)
    box, drift = state_box(FLOW, lower, upper, e, acting), time_widening(FLOW, FLOW.rates, lower, upper, e, acting)
    assert box is not None
    assert drift is not None
    low, high = (np.asarray(v) for v in acting.bounds()) if isinstance(acting, Orthotope) else (acting, acting)
    for s in (t - e, t - e // 2, t, t + e // 3, t + e):
        now, u = course.at(s), inputs.at(s)
        # y(s) − D u for the u of the hull that is nearest, against the strip on x(t)
        gap = abs(now[0] - x[0])
        nearest = min(max(u[0], low[0]), high[0])
        if not inside(*box.bounds(), now) or gap > Fraction(drift[0]) or nearest != u[0]:
            return 1
    return 0


def test_the_box_and_the_strip_hold_whatever_the_true_moment_is() -> None:
    rng = np.random.default_rng(1)
    assert sum(missed(rng, both_sides=True) for _ in range(3000)) == 0


def test_the_input_of_one_side_is_not_enough() -> None:
    rng = np.random.default_rng(1)
    assert sum(missed(rng, both_sides=False) for _ in range(300)) > 30


def test_the_widening_is_no_larger_than_it_must_be() -> None:
    """|d/dt x₁| is at most the speed, ± e (|u| + rho)."""
    drift = time_widening(FLOW, FLOW.rates, np.array([0.0, 2.0]), np.array([1.0, 3.0]), ERROR_NS, [1.0])
    assert drift is not None
    assert drift[0] == pytest.approx(0.04 * (3.0 + 0.04 * 1.5), rel=1e-3)
    assert drift[0] >= 0.04 * (3.0 + 0.04 * 1.5)
    np.testing.assert_array_equal(time_widening(FLOW, FLOW.rates, np.zeros(2), np.ones(2), 0, [1.0]), [0.0])


def test_a_long_error_is_cut_into_pieces_and_a_hopeless_one_is_told() -> None:
    stiff = LSUModel.continuous([[-100.0]], None, [[1.0]], [1.0], [0.1])
    box = state_box(stiff, np.array([1.0]), np.array([1.0]), 20_000_000)  # e ‖A‖ = 2
    assert box is not None
    assert box.lower[0] <= 1.0 * np.exp(-2.0)
    assert box.upper[0] >= np.exp(2.0)
    assert state_box(stiff, np.array([1.0]), np.array([1.0]), 10 * SECOND) is None
    with pytest.raises(ModelError, match="must not be negative"):
        state_box(stiff, np.array([1.0]), np.array([1.0]), -1)


def test_the_domain_holds_at_every_moment() -> None:
    limited = LSUModel.continuous([[0.0]], None, [[1.0]], [1.0], [0.1], domain=([0.0], [1.0]))
    box = state_box(limited, np.array([0.9]), np.array([0.95]), SECOND)
    assert box is not None
    np.testing.assert_array_equal(np.ravel(box.bounds()), [0.0, 1.0])


def test_held_inputs() -> None:
    inputs = HeldInputs([10, 20], [np.array([1.0]), np.array([3.0])], before=Orthotope([-1.0], [0.0]))
    assert inputs.at(20) == np.array([3.0])
    pieces = list(inputs.pieces(5, 30))
    assert [length for length, *_ in pieces] == [5, 10, 10]
    assert [u for _, u, *_ in pieces[1:]] == [np.array([1.0]), np.array([3.0])]
    assert isinstance(pieces[0][1], Orthotope)
    hull = inputs.hull(5, 20)
    assert isinstance(hull, Orthotope)
    np.testing.assert_array_equal(np.ravel(hull.bounds()), [-1.0, 3.0])
    assert inputs.hull(12, 12) == np.array([1.0])
    assert HeldInputs.constant().hull(0, 5) is None
    with pytest.raises(ModelError, match="the times must increase"):
        HeldInputs([2, 1], [None, None])
