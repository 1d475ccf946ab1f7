"""LSUP and ZonotopicKalman: the box beside the set, rows that tell nothing new, and units that do not matter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import LSUP, LSUModel, Orthotope, ZonotopicKalman, run_filter, simulate, systems
from lsu_mesh.filters.filter import Filter
from lsu_mesh.kernels.zonotopes.zonotopic_kalman import kalman_gain

BATTERY = LSUModel([[1.0, -0.1], [0.0, 1.0]], [[0.1], [0.0]], [[1.0, 0.0]], [0.05, 0.0], 0.3)
"""A charge, counted by a current whose bias is constant."""
MADE: dict[str, Callable[..., Filter]] = {
    "LSUP image": LSUP,
    "LSUP cgz": lambda model, prior, **options: LSUP(model, prior, time_update="cgz", **options),
    "LSUP strips": lambda model, prior, **options: LSUP(model, prior, time_update="strips", **options),
    "ZonotopicKalman": ZonotopicKalman,
    "ZonotopicKalman predictor": lambda model, prior, **options: ZonotopicKalman(
        model, prior, form="predictor", **options
    ),
}


def box(n: int, half_width: float = 1.0) -> Orthotope:
    return Orthotope([-half_width] * n, [half_width] * n)


def stable(n: int) -> LSUModel:
    """A chain that forgets, measured at every third link; the spectral radius of |A| is 1.02."""
    A = 0.7 * np.eye(n) + 0.16 * np.eye(n, k=1) - 0.16 * np.eye(n, k=-1)
    return LSUModel(A, None, np.eye(n)[::3], 0.05, 0.2)


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
def test_what_is_known_of_a_constant_is_never_lost(make: Callable[..., Filter]) -> None:
    data = simulate(BATTERY, 300, seed=3)
    run = run_filter(make(BATTERY, box(2)), data.Y, data.U)
    bias = slice(1, 2)
    assert (np.diff(run.lower[:, bias], axis=0) >= 0.0).all()
    assert (np.diff(run.upper[:, bias], axis=0) <= 0.0).all()
    assert run.lower[0, 1] >= -1.0
    assert run.upper[0, 1] <= 1.0
    assert ((run.lower <= data.X) & (run.upper >= data.X)).all()
    alone = run_filter(make(BATTERY, box(2), box=False), data.Y, data.U)
    assert (alone.upper - alone.lower)[:, 1].max() > 2.1 or "strips" in str(make)


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
def test_the_set_takes_nothing_from_the_box(make: Callable[..., Filter]) -> None:
    model = systems.get("P3")
    data = simulate(model, 60, seed=2)
    beside, alone = make(model, box(3)), make(model, box(3), box=False)
    for y, u in zip(data.Y, data.U, strict=True):
        for filter in (beside, alone):
            filter.update(y)
        np.testing.assert_array_equal(beside.support.center, alone.support.center)
        np.testing.assert_array_equal(beside.support.generators, alone.support.generators)
        assert beside.volume() == alone.volume()
        (low, high), (alone_low, alone_high) = beside.bounds(), alone.bounds()
        assert ((low >= alone_low) & (high <= alone_high)).all()
        for filter in (beside, alone):
            filter.predict(u)


@pytest.mark.parametrize("make", list(MADE.values())[:4], ids=list(MADE)[:4])
@pytest.mark.parametrize("with_box", [True, False])
def test_a_filter_goes_on_from_what_it_published(make: Callable[..., Filter], with_box: bool) -> None:
    data = simulate(BATTERY, 40, seed=3)
    one = make(BATTERY, box(2), box=with_box)
    run_filter(one, data.Y[:20], data.U[:20])
    assert one.is_resumable
    other = make(BATTERY, box(2, 9.0), box=with_box)
    other.resume(one.support, *(side.copy() for side in one.bounds()))
    assert one.density is not None
    other.take_density(one.density)
    for k in range(19, 39):
        for filter in (one, other):
            filter.predict(data.U[k])
            filter.update(data.Y[k + 1])
        np.testing.assert_array_equal(one.bounds(), other.bounds())
        np.testing.assert_array_equal(one.support.generators, other.support.generators)
        np.testing.assert_array_equal(one.point, other.point)


@pytest.mark.parametrize("kind", [LSUP, ZonotopicKalman])
def test_bounds_of_a_stable_system_of_30_states_do_not_diverge(kind: Callable[..., Filter]) -> None:
    model = stable(30)
    data = simulate(model, 200, seed=1)
    options = {"order": 90} if kind is ZonotopicKalman else {}
    run = run_filter(kind(model, box(30), **options), data.Y)
    assert ((run.lower <= data.X) & (run.upper >= data.X)).all()
    widths = (run.upper - run.lower).mean(axis=1)
    assert widths[-1] < 2.0


def test_two_equal_sensors_without_noise_are_used() -> None:
    model = LSUModel(np.eye(2), None, [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0.1, [0.0, 0.0, 0.2])
    filter = ZonotopicKalman(model, box(2))
    filter.update([0.5, 0.5, 0.25])
    lower, upper = filter.support.bounds()
    assert upper[0] - lower[0] < 1e-12
    assert lower[0] <= 0.5 <= upper[0]
    assert upper[1] - lower[1] < 0.47  # the optimal gain leaves 6 / 13


@pytest.mark.parametrize("seed", range(20))
def test_rows_one_after_the_other_give_the_optimal_gain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    H, C, r = rng.normal(size=(n, n + 2)), rng.normal(size=(m, n)), rng.uniform(0.1, 1.0, m)
    P = H @ H.T
    expected = P @ C.T @ np.linalg.inv(C @ P @ C.T + np.diag(r**2))
    np.testing.assert_allclose(kalman_gain(H, C, r), expected, rtol=1e-8, atol=1e-9)
    scale = 10.0 ** rng.uniform(-100, 100)  # squares of these numbers leave double precision
    np.testing.assert_allclose(kalman_gain(scale * H, C, scale * r), expected, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("seed", range(4))
def test_units_of_the_states_do_not_matter(name: str, seed: int) -> None:
    make, plain = MADE[name], systems.get("P3")
    data = simulate(plain, 60, seed=seed)
    d = 10.0 ** np.random.default_rng(seed).uniform(-4.0, 4.0, 3)
    scaled = LSUModel(
        np.diag(d) @ plain.A @ np.diag(1.0 / d), d[:, None] * np.array(plain.B), np.array(plain.C) / d,
        plain.rho * d, plain.r,
    )  # fmt: skip
    usual = run_filter(make(plain, box(3)), data.Y, data.U)
    other = run_filter(make(scaled, Orthotope(-d, d)), data.Y, data.U)
    np.testing.assert_allclose((other.upper - other.lower) / d, usual.upper - usual.lower, rtol=0.03)
