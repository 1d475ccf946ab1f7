"""The Kalman filter against the textbook form, its truncation against the rotation of Simon & Simon."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf
from scipy.stats import truncnorm

from lsu_mesh import InconsistentData, Kalman, LSUModel, ModelError, Orthotope, TruncatedKalman, simulate, systems
from lsu_mesh.array_types import Array
from lsu_mesh.filters.kalman import Gaussian
from lsu_mesh.filters.truncated_kalman import truncated, truncated_normal

P3 = systems.get("P3")
PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)


def test_it_is_the_textbook_filter() -> None:
    data = simulate(P3, 30, 1)
    filter = Kalman(P3, PRIOR)
    x, P = np.zeros(3), np.eye(3) / 3
    Q, R = np.diag(P3.rho**2 / 3), np.diag(P3.r**2 / 3)
    assert P3.B is not None
    for y, u in zip(data.Y, data.U, strict=True):
        filter.update(y)
        K = P @ P3.C.T @ np.linalg.inv(P3.C @ P @ P3.C.T + R)
        x, P = x + K @ (y - P3.C @ x), (np.eye(3) - K @ P3.C) @ P
        np.testing.assert_allclose(filter.point, x, atol=1e-12)
        np.testing.assert_allclose(filter.covariance, P, atol=1e-12)
        filter.predict(u)
        x, P = P3.A @ x + P3.B @ u, P3.A @ P @ P3.A.T + Q


def test_a_missing_output_is_left_out_and_a_noise_map_is_used() -> None:
    model = P3.replace(noise_map=[[1.0], [2.0], [0.0]], rho=[0.3])
    filter = Kalman(model, PRIOR)
    alone = Kalman(model.replace(C=model.C[:1], r=model.r[:1]), PRIOR)
    filter.update([0.3, np.nan])
    alone.update([0.3])
    np.testing.assert_allclose(filter.point, alone.point)
    before = filter.covariance
    filter.predict([0.0])
    noise = filter.covariance - model.A @ before @ model.A.T
    np.testing.assert_allclose(noise, 0.03 * np.outer([1, 2, 0], [1, 2, 0]), atol=1e-15)


def by_rotation(mean: Array, P: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Simon & Simon 2010 as they write it: eigenvectors, Gram–Schmidt, one normalised coordinate truncated."""
    for i in range(mean.size):
        phi = np.eye(mean.size)[i]
        W, T = np.linalg.eigh(P)
        root = np.diag(np.sqrt(W))
        first = root @ T.T @ phi / np.sqrt(phi @ P @ phi)
        S = np.linalg.qr(np.column_stack([first, np.eye(mean.size)]))[0].T
        S[0] = first
        s = np.sqrt(phi @ P @ phi)
        c, d = (lower[i] - mean[i]) / s, (upper[i] - mean[i]) / s
        alpha = np.sqrt(2 / np.pi) / (erf(d / np.sqrt(2)) - erf(c / np.sqrt(2)))
        mu = alpha * (np.exp(-(c**2) / 2) - np.exp(-(d**2) / 2))
        variance = alpha * (np.exp(-(c**2) / 2) * (c - 2 * mu) - np.exp(-(d**2) / 2) * (d - 2 * mu)) + mu**2 + 1
        z, C = np.zeros(mean.size), np.eye(mean.size)
        z[0], C[0, 0] = mu, variance
        mean, P = T @ root @ S.T @ z + mean, T @ root @ S.T @ C @ S @ root @ T.T
    return mean, P


@pytest.mark.parametrize("seed", range(20))
def test_the_truncation_is_that_of_simon_and_simon(seed: int) -> None:
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(3, 3))
    held = Gaussian(rng.normal(size=3) * 0.3, G @ G.T / 3)
    lower, upper = -rng.uniform(0.3, 1, 3), rng.uniform(0.3, 1, 3)
    own = truncated(held, lower, upper)
    mean, P = by_rotation(held.mean, held.covariance, lower, upper)
    scale = max(1.0, np.abs(held.covariance).max())
    np.testing.assert_allclose(own.mean, mean, rtol=0, atol=1e-14 * scale)
    np.testing.assert_allclose(own.covariance, P, rtol=0, atol=1e-14 * scale)


@pytest.mark.parametrize(("c", "d"), [(-1.0, 2.0), (3.0, 4.0), (8.0, 9.0), (-9.0, -8.0), (-0.5, -0.4), (20.0, np.inf)])
def test_moments_of_the_truncated_normal(c: float, d: float) -> None:
    mean, variance = truncnorm.stats(c, d, moments="mv")
    assert truncated_normal(c, d) == pytest.approx((float(mean), float(variance)), rel=1e-7)


def test_far_out_and_very_narrow_limits_leave_a_point_inside() -> None:
    for c, d in [(100.0, 101.0), (-1e6, -1e6 + 1), (0.3, 0.3 + 1e-12), (-np.inf, -40.0)]:
        mean, variance = truncated_normal(c, d)
        assert c <= mean <= d
        assert 0 <= variance <= 1


def test_points_stay_in_the_domain() -> None:
    model = P3.replace(domain=([-0.3] * 3, [0.3] * 3))
    filter = TruncatedKalman(model, PRIOR)
    for y, u in zip(*simulate(P3, 50, 1)[1:], strict=True):
        filter.update(y)
        assert (np.abs(filter.point) <= 0.3).all()
        filter.predict(u)


def test_without_feedback_the_recursion_is_the_plain_filter() -> None:
    model = P3.replace(domain=([-0.3] * 3, [0.3] * 3))
    plain, truncating = Kalman(model, PRIOR), TruncatedKalman(model, PRIOR, feedback=False)
    for y, u in zip(*simulate(P3, 20, 1)[1:], strict=True):
        plain.update(y)
        truncating.update(y)
        np.testing.assert_array_equal(truncating.untruncated.covariance, plain.covariance)
        plain.predict(u)
        truncating.predict(u)
        np.testing.assert_array_equal(plain.covariance, truncating.covariance)
        np.testing.assert_array_equal(np.clip(plain.point, -0.3, 0.3), truncating.point)


def test_snapshots_and_transfers() -> None:
    filter = TruncatedKalman(P3.replace(domain=([-2.0] * 3, [2.0] * 3)), PRIOR)
    filter.update([0.1, 0.2])
    snapshot = filter.snapshot()
    assert filter.condition(Orthotope([-0.1] * 3, [0.1] * 3)) > 0
    filter.restore(snapshot)
    with pytest.raises(InconsistentData, match="no point in common"):
        filter.condition(Orthotope([9.0] * 3, [10.0] * 3))


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ModelError, match="give the model one"):
        TruncatedKalman(P3, PRIOR)
    with pytest.raises(ModelError, match="sigmas must be a number > 0"):
        Kalman(LSUModel([[1.0]], None, [[1.0]], 0.1, 0.1), ([0.0], [1.0]), sigmas=-1.0)
