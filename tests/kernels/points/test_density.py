"""The recursion of mean and covariance, beside plain matrices; noise over a stretch, beside the matrix exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from lsu_mesh import LSUPB, LSUModel, Orthotope
from lsu_mesh.filters.density import noise_covariance
from lsu_mesh.kernels.points import density
from lsu_mesh.kernels.points.room import room


def random_density(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    root = rng.normal(size=(n, n))
    return rng.normal(size=n), root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("seed", range(8))
def test_a_data_update_is_the_one_of_kalman(seed: int) -> None:
    """A missing row is none; what widens a strip beyond r is an independent error."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), 4
    (mean, P), C = random_density(rng, n), rng.normal(size=(m, n))
    y, r = rng.normal(size=m), rng.uniform(0.1, 1.0, m)
    widths = r + np.array([0.0, 0.5, 0.0, -0.05])
    y[2] = np.nan
    known = [0, 1, 3]
    variance = np.array([r[0] ** 2, r[1] ** 2 + 0.25, (r[3] - 0.05) ** 2]) / 3.0
    H = C[known]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(variance))
    expected = mean + K @ (y[known] - H @ mean), P - K @ H @ P
    density.update(mean, P, C, y, widths, r, room(n))
    np.testing.assert_allclose(mean, expected[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(P, expected[1], rtol=1e-8, atol=1e-12)
    assert (P == P.T).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_time_update_is_the_one_of_kalman(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, q, p = int(rng.integers(1, 6)), 3, 2
    (mean, P), A, B = random_density(rng, n), rng.normal(size=(n, n)), rng.normal(size=(n, p))
    G, widths, u = rng.normal(size=(n, q + p)), rng.uniform(0.0, 1.0, q + p), rng.normal(size=p)
    Q = np.zeros((n, n))
    density.noise_covariance(np.ascontiguousarray(G[:, :q]), widths[:q].copy(), Q)
    expected = A @ mean + B @ u, A @ P @ A.T + (G * widths**2 / 3.0) @ G.T
    density.predict(mean, P, A, B, u, Q, G, widths, q, room(n))
    np.testing.assert_allclose(mean, expected[0], rtol=1e-12)
    np.testing.assert_allclose(P, expected[1], rtol=1e-12, atol=1e-13)


def test_a_density_that_overflows_starts_again_from_the_hull() -> None:
    model = LSUModel(A=np.diag([1e120, 0.5]), B=None, C=np.eye(2), rho=0.1, r=0.1)
    filter = LSUPB(model, Orthotope([-1e60, -1.0], [1e60, 1.0]))
    filter.predict()
    filter.predict(model=model.replace(A=np.diag([1e-30, 0.5])))
    held = filter.density
    assert held is not None
    assert np.isfinite(held.mean).all()
    assert np.isfinite(held.covariance).all()
    assert filter.support.contains(filter.point)


@pytest.mark.parametrize("seconds", [1e-4, 0.1, 3.0, 40.0])
def test_noise_over_a_stretch_is_van_loans_integral(seconds: float) -> None:
    rng = np.random.default_rng(3)
    A, N, rho = rng.normal(size=(3, 3)) - 1.5 * np.eye(3), rng.normal(size=(3, 2)), np.array([0.1, 0.4])
    flow = LSUModel.continuous(A, None, np.eye(3), rho=rho, r=0.1, noise_map=N)
    S = (N * rho**2 / 3.0) @ N.T
    both = expm(np.block([[-A, S], [np.zeros((3, 3)), A.T]]) * seconds) if seconds < 10 else None
    found = noise_covariance(flow.discretised(round(seconds * 1e9)), 10**8)
    if both is not None:
        expected = both[3:, 3:].T @ both[:3, 3:]
        np.testing.assert_allclose(found, 0.1 * expected, rtol=1e-6, atol=1e-15)
    half, E = noise_covariance(flow.discretised(round(seconds * 5e8)), 10**8), expm(A * seconds / 2)
    np.testing.assert_allclose(found, half + E @ half @ E.T, rtol=1e-9, atol=1e-16)


def test_the_truncated_mean_lies_in_the_box_and_is_the_mean_of_independent_coordinates() -> None:
    mean, P = np.array([0.0, 3.0, 0.2]), np.diag([1.0, 0.25, 0.0])
    lower, upper, point = np.array([-1.0, -2.0, -1.0]), np.array([1.0, 2.0, 0.1]), np.empty(3)
    density.truncated_mean(mean, P, lower, upper, point, room(3))
    assert point[0] == pytest.approx(0.0, abs=1e-12)
    assert point[1] == pytest.approx(3.0 + 0.5 * -2.3732155, abs=1e-6)  # N(0, 1) on [−10, −2]
    assert point[2] == 0.1
