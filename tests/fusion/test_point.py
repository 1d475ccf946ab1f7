"""The point of a fused set: the sources' points, weighted, and moved into the set."""

from __future__ import annotations

import numpy as np
import pytest
from random_models import random_model

from lsu_mesh import LSUCZ, LSUO, LSUPB, LSUModel, ModelError, Orthotope, fuse, simulate, systems
from lsu_mesh.fusion.point import weighted_mean


def test_points_are_weighted_by_inverse_squared_widths() -> None:
    wide, narrow = Orthotope([0.0, 0.0], [4.0, 1.0]), Orthotope([1.0, -1.0], [3.0, 1.0])
    fused = fuse([wide, narrow], points=[[1.0, 0.5], [2.0, 0.25]])
    # widths 4 and 2: weights 1/16 and 1/4; 1 and 2: 1 and 1/4
    assert fused.point == pytest.approx([(1.0 / 16 + 2.0 / 4) / (5 / 16), (0.5 + 0.25 / 4) / 1.25])
    assert fuse([wide, narrow], point="centre").point.tolist() == [2.0, 0.5]


def test_a_source_without_width_counts_alone() -> None:
    exact = (np.array([0.5, 0.0]), np.array([0.5, -1.0]), np.array([0.5, 1.0]))
    other = (np.array([0.1, 1.0]), np.array([0.0, -1.0]), np.array([1.0, 1.0]))
    assert weighted_mean([other, exact]).tolist() == [0.5, 0.5]


@pytest.mark.parametrize(("policy", "faults"), [("intersect", 0), ("relaxed", 1)])
@pytest.mark.parametrize("system", [("S1", 0.05, 0.02), ("S2", 0.1, 0.1), ("S3", 0.1, 0.1), ("P3", 0.1, 0.3)], ids=str)
def test_the_fused_point_lies_in_the_fused_set(policy: str, faults: int, system: tuple[str, float, float]) -> None:
    name, rho, r = system
    check_points(systems.get(name, rho=rho, r=r), policy, faults, steps=12)


@pytest.mark.parametrize(("policy", "faults"), [("intersect", 0), ("relaxed", 1)])
@pytest.mark.parametrize("first", [0, pytest.param(10, marks=pytest.mark.soak)])
def test_the_fused_point_lies_in_the_fused_set_of_random_models(policy: str, faults: int, first: int) -> None:
    for seed in range(first, 10 if first == 0 else 200):
        check_points(random_model(seed), policy, faults, steps=4)


def check_points(model: LSUModel, policy: str, faults: int, steps: int) -> None:
    n = model.state_count
    filters = [kind(model, Orthotope([-1.0] * n, [1.0] * n)) for kind in (LSUO, LSUPB, LSUCZ)]
    data = simulate(model, steps, seed=3, x1=np.zeros(n))
    for y, u in zip(data.Y, data.U, strict=True):
        for filter in filters:
            filter.update(y)
        for rule in ("mean", "nearest"):
            points = [filter.point for filter in filters]
            fused = fuse([one.support for one in filters], policy, faults, point=rule, points=points)  # type: ignore[arg-type]
            lower, upper = fused.bounds
            assert ((lower <= fused.point) & (fused.point <= upper)).all()
            assert fused.support.contains(fused.point)
        for filter in filters:
            filter.predict(u)


def test_points_must_be_one_per_source() -> None:
    with pytest.raises(ModelError, match="one per support, 1; there are 2"):
        fuse([Orthotope([0.0], [1.0])], points=[[0.0], [0.5]])
    with pytest.raises(ModelError, match='point must be "mean"'):
        fuse([Orthotope([0.0], [1.0])], point="middle")  # type: ignore[arg-type]
