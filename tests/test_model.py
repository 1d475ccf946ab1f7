"""Continuous models: what they give for a stretch of time, and what they refuse."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUO, ContinuousModel, LSUModel, ModelError, Orthotope, WindowMAP, ZonotopicKalman
from lsu_mesh.identification import explain

SECOND = 10**9


def motion(**options: object) -> ContinuousModel:
    """Position and velocity, driven and disturbed by an acceleration."""
    return LSUModel.continuous(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [0.5], [0.1], [[0.0], [1.0]], **options
    )


def test_a_stretch_is_a_model_with_names_and_radii() -> None:
    flow = motion(states=["position", "velocity"], domain=([-9.0, -9.0], [9.0, 9.0]), a=[0.0, -9.81], d=[1.0])
    step = flow.discretised(SECOND // 2)
    np.testing.assert_allclose(step.A, [[1.0, 0.5], [0.0, 1.0]], rtol=1e-14)
    np.testing.assert_allclose(step.B, [[0.125], [0.5]], rtol=1e-14)  # type: ignore[arg-type]
    np.testing.assert_allclose(step.a, [-9.81 / 8, -9.81 / 2], rtol=1e-14)  # type: ignore[arg-type]
    assert step.states == ("position", "velocity")
    assert step.domain is not None
    assert step.flow is flow
    assert step.radii is not None
    assert step.radii.A.max() < 1e-14
    assert step.noise_share is not None
    assert (step.noise_share < 1e-13).all()
    assert flow.discretised(SECOND // 2) is step
    assert flow.discretised(np.int64(SECOND // 2)) is step  # type: ignore[arg-type]


def test_two_halves_are_no_narrower_than_the_whole() -> None:
    """Composition: a set carried in pieces holds the one that is carried at once, but for rounding."""
    flow = motion()
    one, two = LSUCZ(flow.discretised(SECOND), Orthotope([0.0, 1.0], [1.0, 2.0])), None
    two = LSUCZ(flow.discretised(SECOND), Orthotope([0.0, 1.0], [1.0, 2.0]))
    one.predict([1.0])
    for part in (0.25, 0.75):
        two.predict([1.0], model=flow.discretised(round(part * SECOND)))
    np.testing.assert_allclose(one.bounds(), two.bounds(), rtol=1e-12)
    np.testing.assert_allclose(one.bounds()[1], [1.0 + 2.0 + 0.5 + 0.25, 2.0 + 1.0 + 0.5], rtol=1e-12)


def test_changes_of_outputs_keep_the_stretch_and_changes_of_dynamics_end_it() -> None:
    step = motion().discretised(SECOND)
    seen = step.replace(C=[[0.0, 1.0]], r=[0.2])
    assert seen.radii is not None
    assert seen.flow is not None
    np.testing.assert_array_equal(seen.flow.rates.C, [[0.0, 1.0]])
    assert step.replace(A=np.eye(2)).radii is None
    assert step.replace(A=np.eye(2)).flow is None
    assert motion().replace(rho=[1.0]).discretised(SECOND).noise_map is not None


def test_radii_of_a_users_own_model_are_charged() -> None:
    """A known to ± .1: the image of x = 10 is known to ± 1."""
    from lsu_mesh.model import Radii

    model = LSUModel(
        [[1.0]], [[1.0]], [[1.0]], [0.5], [0.1], radii=Radii(np.array([[0.1]]), np.array([[0.2]]), np.array([0.3]))
    )
    for made in (LSUO, LSUCZ, ZonotopicKalman):
        filter = made(model, Orthotope([9.0], [10.0]))  # type: ignore[operator]
        filter.predict([2.0])
        np.testing.assert_allclose(np.ravel(filter.bounds()), [11.0 - 0.5 - 1.7, 12.0 + 0.5 + 1.7], rtol=1e-12)
        filter.predict(Orthotope([0.0], [2.0]), rho=[0.25])
        assert filter.bounds()[1][0] == pytest.approx(14.2 + 2.0 + 0.25 + 1.42 + 0.4 + 0.3)
    with pytest.raises(ModelError, match=r"radii.A must be of shape \(1, 1\) and not negative"):
        LSUModel([[1.0]], None, [[1.0]], 0.5, 0.1, radii=Radii(np.array([[-0.1]]), np.zeros((1, 0)), np.zeros(1)))


@pytest.mark.parametrize("h_ns", [0, -5, 1.5, True, "1"])
def test_a_length_that_is_none_is_refused(h_ns: object) -> None:
    with pytest.raises(ModelError, match="whole number of nanoseconds"):
        motion().discretised(h_ns)  # type: ignore[arg-type]


def test_a_stretch_too_long_and_a_continuous_model_in_the_wrong_place_are_named() -> None:
    unstable = LSUModel.continuous([[5.0]], None, [[1.0]], [1.0], [1.0])
    with pytest.raises(ModelError, match="a stretch of 1000000000000 ns is too long for this model"):
        unstable.discretised(1000 * SECOND)
    with pytest.raises(ModelError, match=r"a filter takes the model of a step, not ContinuousModel.*discretised"):
        LSUO(unstable, Orthotope([0.0], [1.0]))  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="window estimators know no continuous model"):
        WindowMAP(unstable, Orthotope([0.0], [1.0]))  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="explain takes a discrete model"):
        explain(unstable, [[0.0], [1.0]])  # type: ignore[arg-type]


@pytest.mark.alone
def test_a_stretch_costs_a_tenth_of_a_millisecond_and_a_known_one_nothing() -> None:
    rng = np.random.default_rng(0)
    flow = LSUModel.continuous(
        rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), np.eye(4), np.ones(2), 1.0, rng.normal(size=(4, 2))
    )
    flow.discretised(SECOND)

    def fastest(work: Callable[[int], object]) -> float:
        durations = []
        for k in range(300):
            began = time.perf_counter()
            work(k)
            durations.append(time.perf_counter() - began)
        return min(durations)

    assert fastest(lambda k: flow.discretised(SECOND // 10 + k)) <= 100e-6
    assert fastest(lambda k: flow.discretised(SECOND)) <= 2e-6
