"""Points: in the set by every rule but the centre, near the mean of all that is known, the same by every way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from random_models import random_model

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, FilterBank, LSUModel, Orthotope, run_filter, simulate, systems
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.testing import check_filter

RULES = ("mean", "nearest")
SETS = ("LSUO", "LSUP", "LSUPB", "LSUCZ", "ZonotopicKalman")
OPTIONS: dict[str, dict[str, Any]] = {"WindowMAP": {"window": 4}}
SYSTEMS = [("S1", 0.05, 0.02), ("S1", 0.1, 0.1), ("S2", 0.1, 0.1), ("S3", 0.1, 0.1), ("P3", 0.1, 0.3), ("P3", 0.1, 0.1)]


def unit(n: int, size: float = 1.0) -> Orthotope:
    return Orthotope([-size] * n, [size] * n)


def check_points(kind: str, model: LSUModel, steps: int, seed: int) -> None:
    """After every data update and every prediction, the point is in the bounds, and nothing proves it outside."""
    n = model.state_count
    data = simulate(model, steps, seed=seed, x1=np.random.default_rng(seed).uniform(-1, 1, n))
    for rule in RULES:
        filter = filter_class(kind)(model, unit(n), point=rule, **OPTIONS.get(kind, {}))  # type: ignore[call-arg]
        assert filter.point_rule == rule
        for k in range(2 * steps - 1):
            filter.predict(data.U[k // 2]) if k % 2 else filter.update(data.Y[k // 2])
            (lower, upper), point = filter.bounds(), filter.point
            assert ((lower <= point) & (point <= upper)).all(), (kind, rule, seed, k)
            assert filter.support.contains(point), (kind, rule, seed, k)


@pytest.mark.parametrize("kind", sorted(FILTERS))
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: f"{system[0]}-{system[1]}-{system[2]}")
def test_points_lie_in_the_sets_of_the_papers_systems(kind: str, system: tuple[str, float, float]) -> None:
    name, rho, r = system
    model = systems.get(name, rho=rho, r=r)
    check_points(kind, model.replace(domain=unit(model.state_count, 1e3)), steps=15, seed=1)


@pytest.mark.parametrize("kind", sorted(FILTERS))
@pytest.mark.parametrize("first", [0, pytest.param(10, marks=pytest.mark.soak)])
def test_points_lie_in_the_sets_of_random_models(kind: str, first: int) -> None:
    for seed in range(first, 10 if first == 0 else 200):
        check_points(kind, random_model(seed), steps=6, seed=seed)


def bayes_means(model: LSUModel, Y: np.ndarray, U: np.ndarray, count: int) -> np.ndarray:
    """Means (T, n) of x_k given y_1 … y_k, by particles: uniform noise, so data keep or remove a particle."""
    rng = np.random.default_rng(7)
    n = model.state_count
    X = rng.uniform(-1.0, 1.0, (count, n))
    means = np.empty((len(Y), n))
    for k, (y, u) in enumerate(zip(Y, U, strict=True)):
        X = X[(np.abs(y - X @ model.C.T) <= model.r).all(axis=1)]
        assert len(X) > 0, "all particles are lost: take another seed, or more of them"
        means[k] = X.mean(axis=0)
        X = X[rng.integers(len(X), size=count)]
        X = X @ model.A.T + model.B @ u + rng.uniform(-model.rho, model.rho, (count, n))  # type: ignore[operator]
    return means


@pytest.mark.parametrize(
    ("name", "r", "most"), [("P3", 0.3, 1.06), ("P3", 0.1, 1.02), ("S1", 0.1, 1.02), ("S2", 0.1, 1.02)]
)
@pytest.mark.parametrize("size", [(20_000, 3), pytest.param((100_000, 4), marks=pytest.mark.soak)], ids=str)
def test_the_mean_is_near_the_optimum(name: str, r: float, most: float, size: tuple[int, int]) -> None:
    """Root mean square error, steps from 10 on, ÷ that of the mean of all that is known."""
    model, (count, seeds) = systems.get(name, rho=0.1, r=r), size
    best: list[np.ndarray] = []
    errors: dict[str, list[np.ndarray]] = {kind: [] for kind in SETS}
    for seed in range(seeds):
        data = simulate(model, 120, seed=seed, x1=np.random.default_rng(seed).uniform(-1, 1, model.state_count))
        best.append(np.square(bayes_means(model, data.Y, data.U, count) - data.X)[9:].sum(axis=1))
        for kind in SETS:
            run = run_filter(filter_class(kind)(model, unit(model.state_count)), data.Y, data.U, volumes=False)  # type: ignore[call-arg]
            errors[kind].append(np.square(run.points - data.X)[9:].sum(axis=1))
    for kind in SETS:
        assert np.sqrt(np.mean(errors[kind]) / np.mean(best)) <= most, kind


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB])
@pytest.mark.parametrize("rule", ["mean", "nearest", "centre"])
def test_loop_bank_and_single_steps_give_the_same_points(kind: Callable[..., Any], rule: str) -> None:
    model = systems.get("S1", rho=0.1, r=0.1).replace(domain=unit(3, 3.0))
    data = simulate(model, 30, seed=4)
    data.Y[5] = np.nan
    run = run_filter(kind(model, unit(3), point=rule), data.Y, data.U)
    bank, done = FilterBank(kind, model, [unit(3), unit(3)], point=rule).run([data.Y, data.Y], [data.U, data.U])  # type: ignore[arg-type]
    assert done.tolist() == [30, 30]
    single = kind(model, unit(3), point=rule)
    for k in range(30):
        np.testing.assert_array_equal(single.predict_output().point, run.y_points[k])
        single.update(data.Y[k])
        np.testing.assert_array_equal(single.point, run.points[k])
        np.testing.assert_array_equal(bank.points[1, k], run.points[k])
        single.predict(data.U[k])


@pytest.mark.parametrize("kind", SETS)
def test_the_rule_changes_no_set(kind: str) -> None:
    model = systems.get("P3")
    data = simulate(model, 25, seed=2)
    runs = [run_filter(filter_class(kind)(model, unit(3), point=rule), data.Y, data.U) for rule in (*RULES, "hull")]  # type: ignore[call-arg]
    for run in runs[1:]:
        np.testing.assert_array_equal(run.lower, runs[0].lower)
        np.testing.assert_array_equal(run.upper, runs[0].upper)
        np.testing.assert_array_equal(run.volumes, runs[0].volumes)
    assert (runs[0].points != runs[2].points).any()


@pytest.mark.parametrize("kind", SETS)
def test_points_are_left_out_on_request(kind: str) -> None:
    model = systems.get("P3")
    data = simulate(model, 10, seed=2)
    for rule in ("mean", "centre"):
        filters = [filter_class(kind)(model, unit(3), point=rule) for _ in range(2)]  # type: ignore[call-arg]
        without = run_filter(filters[0], data.Y, data.U, points=False)
        run_filter(filters[1], data.Y, data.U)
        assert np.isnan(without.points).all()
        assert np.isnan(without.y_points).all()
        np.testing.assert_array_equal(filters[0].point, filters[1].point)


def test_transferred_sets_do_not_enter_the_density() -> None:
    model = systems.get("P3")
    for kind in SETS:
        filter = filter_class(kind)(model, unit(3))  # type: ignore[call-arg]
        filter.update([0.1, 0.2])
        before = filter.density
        filter.condition(Orthotope([-0.2] * 3, [0.4] * 3))
        after = filter.density
        assert before is not None
        assert after is not None
        np.testing.assert_array_equal(before.covariance, after.covariance)


def test_other_words_are_refused() -> None:
    for kind in FILTERS:
        with pytest.raises(ModelError, match='point must be "mean"'):
            filter_class(kind)(systems.get("P3").replace(domain=unit(3)), unit(3), point="middle")  # type: ignore[call-arg]


class OutsideLSUCZ(LSUCZ):
    """Says that its point lies in the set, and publishes the corner of the hull."""

    @property
    def point(self) -> np.ndarray:
        return self.bounds()[1]


class HonestLSUCZ(OutsideLSUCZ):
    """Says that it may lie outside."""

    def __init__(self, model: LSUModel, prior: Orthotope) -> None:
        super().__init__(model, prior, point="centre")


class BeyondLSUO(LSUO):
    """Its point is a unit in the last place beyond the bounds."""

    @property
    def point(self) -> np.ndarray:
        return np.nextafter(self.bounds()[1], np.inf)


def test_the_contract_finds_points_outside() -> None:
    check_filter(HonestLSUCZ, seeds=3, steps=2)
    with pytest.raises(AssertionError, match="by the rule 'mean', outside of the support"):
        check_filter(OutsideLSUCZ, seeds=3, steps=3)
    with pytest.raises(AssertionError, match="by the rule 'mean', outside of the bounds"):
        check_filter(BeyondLSUO, seeds=3, steps=2)
