"""How tight LSUO, LSUP and LSUPB are: the numbers of the papers, and volumes beside the exact polytope."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from lsu_mesh import LSUO, LSUP, LSUPB, LSUModel, Orthotope, metrics, run_filter, simulate, systems
from lsu_mesh.filters.filter import Filter


def prior_of(model: LSUModel, width: float = 1.0) -> Orthotope:
    return Orthotope(np.full(model.state_count, -width), np.full(model.state_count, width))


@pytest.mark.parametrize(("meet", "number", "tolerance"), [(False, 1.2, 0.3), (True, 0.75, 0.2)])
def test_table_1_of_pavelkova_and_jirsa_2018(meet: bool, number: float, tolerance: float) -> None:
    """Σ e² of state 2 over 100 steps of P3, rho = 0.1, r = 0.3; the paper, without the meet, has 1.77 in one run."""
    model = systems.get("P3")
    errors = []
    for seed in range(40):
        data = simulate(model, 100, seed)
        run = run_filter(LSUO(model, prior_of(model), meet=meet, point="centre"), data.Y, data.U)
        assert metrics.containment(run.lower, run.upper, data.X) == 1.0
        errors.append(metrics.tnse(run.points[:, 1:2], data.X[:, 1:2]))
    assert np.mean(errors) == pytest.approx(number, abs=tolerance)


@pytest.mark.parametrize("rho", [0.01, 0.1])
@pytest.mark.parametrize("r", [0.01, 0.1])
def test_volumes_on_s1_of_lainova_et_al_2019(rho: float, r: float) -> None:
    """Volume LSUO (as the paper, without the meet) ÷ LSUP image: 290 … 1330 over rho, r in [0.01, 0.1]."""
    model = systems.get("S1", rho=rho, r=r)
    ratios = []
    for seed in range(5):
        data = simulate(model, 500, seed)
        box = run_filter(LSUO(model, prior_of(model), meet=False), data.Y, data.U)
        body = run_filter(LSUP(model, prior_of(model)), data.Y, data.U)
        ratios.append(box.volumes[10:].mean() / body.volumes[10:].mean())
    assert 290 * 0.85 <= np.mean(ratios) <= 1330 * 1.15


@pytest.mark.parametrize("rho", [0.01, 0.1])
@pytest.mark.parametrize("r", [0.01, 0.1])
def test_output_prediction_on_s2_of_lainova_et_al_2019(rho: float, r: float) -> None:
    """TNSE of the output prediction LSUO ÷ LSUP: 75 … 410; what LSUO never learns is the velocity it started with."""
    model = systems.get("S2", rho=rho, r=r)
    prior, boxes, bodies = prior_of(model, 5.0), 0.0, 0.0
    for seed in range(10):
        x1 = np.random.default_rng(seed).uniform(-5.0, 5.0, 2)
        data = simulate(model, 500, seed, x1=x1)
        boxes += metrics.tnse(run_filter(LSUO(model, prior, point="centre"), data.Y, data.U).y_points, data.Y)
        bodies += metrics.tnse(run_filter(LSUP(model, prior, point="centre"), data.Y, data.U).y_points, data.Y)
    assert 75 <= boxes / bodies <= 410


class ExactPolytope:
    """The exact set of states by vertices and half-spaces, with scipy's geometry only."""

    def __init__(self, model: LSUModel, prior: Orthotope) -> None:
        self.model, self.vertices = model, prior.vertices()
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=model.state_count)))
        self.corners = signs * model.rho

    def update(self, y: np.ndarray) -> None:
        C, r = self.model.C, self.model.r
        strips = np.vstack([np.column_stack([C, -(y + r)]), np.column_stack([-C, y - r])])
        faces = np.vstack([ConvexHull(self.vertices, qhull_options="Qt Q12").equations, strips])
        norms = np.linalg.norm(faces[:, :-1], axis=1, keepdims=True)
        n = C.shape[1]
        chebyshev = linprog(
            np.append(np.zeros(n), -1.0),
            np.hstack([faces[:, :-1], norms]),
            -faces[:, -1],
            bounds=[(None, None)] * (n + 1),
        )
        self.vertices = HalfspaceIntersection(faces, chebyshev.x[:n]).intersections

    def predict(self, u: np.ndarray) -> None:
        image = self.vertices @ self.model.A.T + self.model.B @ u
        cloud = (image[:, None, :] + self.corners).reshape(-1, self.model.state_count)
        self.vertices = cloud[ConvexHull(cloud, qhull_options="Qt Q12").vertices]

    def volume(self) -> float:
        return float(ConvexHull(self.vertices, qhull_options="Qt Q12").volume)


def volume_ratio(make: Callable[[LSUModel], Filter], model: LSUModel, seeds: int, steps: int = 14) -> float:
    """Mean of volume ÷ volume of the exact polytope over the last three steps."""
    ratios = []
    for seed in range(seeds):
        data = simulate(model, steps, seed)
        exact, filter = ExactPolytope(model, prior_of(model)), make(model)
        for k in range(steps):
            exact.update(data.Y[k])
            filter.update(data.Y[k])
            if k >= steps - 3:
                ratios.append(filter.support.volume() / exact.volume())
            exact.predict(data.U[k])
            filter.predict(data.U[k])
    assert min(ratios) >= 1 - 1e-5
    return float(np.mean(ratios))


@pytest.mark.parametrize(
    ("name", "rho", "r", "most"), [("S1", 0.1, 0.01, 2.5), ("S2", 0.1, 0.1, 1.3)], ids=["S1", "S2"]
)
def test_strips_stay_near_the_exact_volume(name: str, rho: float, r: float, most: float) -> None:
    model = systems.get(name, rho=rho, r=r)
    assert volume_ratio(lambda m: LSUP(m, prior_of(m), time_update="strips"), model, seeds=12) <= most


@pytest.mark.parametrize(
    ("name", "rho", "r"), [("S1", 0.1, 0.01), ("P3", 0.1, 0.1), ("S2", 0.1, 0.1), ("S3", 0.1, 0.1)]
)
def test_the_bundle_stays_within_half_again_of_the_exact_volume(name: str, rho: float, r: float) -> None:
    model = systems.get(name, rho=rho, r=r)
    assert volume_ratio(lambda m: LSUPB(m, prior_of(m)), model, seeds=6) <= 1.5


def test_a_bundle_does_not_elongate() -> None:
    """On S3 the least volume of each step makes LSUP ever longer; the box of the bundle stops that."""
    model = systems.get("S3")
    data = simulate(model, 400, seed=1)
    runs = [
        run_filter(make(model, prior_of(model)), data.Y, data.U)
        for make in (LSUPB, lambda m, p: LSUP(m, p, time_update="strips", box=False))
    ]
    bundle, strips = [metrics.mean_width(run.lower[200:], run.upper[200:]).max() for run in runs]
    assert bundle < strips / 2
