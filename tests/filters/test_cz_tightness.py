"""How tight LSU-CZ is: against exact hulls, on the published benchmarks and on P3."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUModel, Orthotope, systems

FOLDER = Path(os.environ.get("LSU_MESH_BENCHMARKS", Path(__file__).parents[2].parent / "shared" / "benchmarks"))


def _benchmark(name: str) -> dict[str, Any]:
    path = FOLDER / f"{name}.json"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return dict(json.loads(path.read_text()))


def _hulls(data: dict[str, Any], *limits: int | None) -> list[tuple[np.ndarray, np.ndarray]]:
    """Interval hull after each update; the noise is a zonotope with generators W."""
    system = data["system"]
    W, V = np.array(system["W"]["generators"]), np.array(system["V"]["generators"])
    prior = np.array(system["R0"]["center"]), np.abs(system["R0"]["generators"]).sum(axis=1)
    model = LSUModel(system["A"], system["B"], system["C"], np.ones(W.shape[1]), np.abs(V).sum(axis=1), noise_map=W)
    estimator = LSUCZ(model, Orthotope(prior[0] - prior[1], prior[0] + prior[1]), *limits)
    hulls = []
    for y, u in zip(np.array(system["y"]).T, np.array(system["u"]).T, strict=True):
        estimator.update(y)
        hulls.append(estimator.bounds())
        estimator.predict(u)
    return hulls


@pytest.mark.parametrize("name", ["twodim", "vehicle2"])
def test_unreduced_hulls_are_exact(name: str) -> None:
    data = _benchmark(name)
    hulls = _hulls(data, None, None)
    for step, exact in data["exact_hulls"].items():
        lower, upper = hulls[int(step)]
        scale = max(1.0, np.abs([exact["lo"], exact["hi"]]).max())
        assert np.abs(lower - exact["lo"]).max() <= 1e-9 * scale
        assert np.abs(upper - exact["hi"]).max() <= 1e-9 * scale


@pytest.mark.parametrize("name", ["twodim", "vehicle2", "pedestrian4"])
@pytest.mark.parametrize("limits", [(12, 4), (20, 8)])
def test_reduced_hulls_contain_the_exact_ones(name: str, limits: tuple[int, int]) -> None:
    data = _benchmark(name)
    hulls = _hulls(data, *limits)
    for step, exact in data["exact_hulls"].items():
        lower, upper = hulls[int(step)]
        scale = max(1.0, np.abs([exact["lo"], exact["hi"]]).max())
        assert (lower <= np.array(exact["lo"]) + 1e-9 * scale).all()
        assert (upper >= np.array(exact["hi"]) - 1e-9 * scale).all()


@pytest.mark.parametrize("name", ["twodim", "vehicle2"])
def test_it_beats_every_published_estimator_that_is_no_constrained_zonotope(name: str) -> None:
    data = _benchmark(name)
    lower, upper = _hulls(data, 20, 8)[data["tightness"]["k"]]
    ratio = (0.5 * (upper - lower) / data["tightness"]["exact_radius"]).mean()
    others = {k: v["mean_ratio"] for k, v in data["tightness"]["estimators"].items() if not k.startswith("CZN")}
    assert ratio < min(others.values())


def _measured(model: LSUModel, seed: int, steps: int, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = spread * rng.uniform(-1, 1, model.state_count)
    states, outputs, inputs = [], [], rng.normal(size=(steps, model.input_count))
    for u in inputs:
        states.append(x)
        outputs.append(model.C @ x + model.r * rng.uniform(-1, 1, model.output_count))
        x = model.A @ x + model.B @ u + model.rho * rng.uniform(-1, 1, model.state_count)
    return np.array(states), np.array(outputs), inputs


def _widths(model: LSUModel, outputs: np.ndarray, inputs: np.ndarray, *limits: int | None) -> np.ndarray:
    estimator = LSUCZ(model, Orthotope(-np.ones(model.state_count), np.ones(model.state_count)), *limits)
    widths = []
    for y, u in zip(outputs, inputs, strict=True):
        estimator.update(y)
        widths.append(np.subtract(*estimator.bounds()[::-1]))
        estimator.predict(u)
    return np.array(widths)


def test_hull_width_on_p3() -> None:
    """Mean over seeds of the hull's width relative to the exact one: at most 1.20 for (12, 4), 1.10 for (20, 8)."""
    model = systems.get("P3", 0.1, 0.3)
    ratios: dict[tuple[int, int], list[float]] = {(12, 4): [], (20, 8): []}
    for seed in range(5):
        _, outputs, inputs = _measured(model, seed, 30)
        exact = _widths(model, outputs, inputs, None, None)[5:]
        for limits, found in ratios.items():
            ratio = _widths(model, outputs, inputs, *limits)[5:] / exact
            assert (ratio >= 1 - 1e-9).all()
            found.append(float(ratio.mean()))
    assert np.mean(ratios[12, 4]) <= 1.20
    assert np.mean(ratios[20, 8]) <= 1.10


@pytest.mark.parametrize("nu", [1e-4, 1e-3, 1e-2, 0.1, 1.0])
def test_rmse_of_p2023(nu: float) -> None:
    """For ω = 1e-4 the error from step 10 of 600 on is at most 1.3e-4 for every ν; the state starts within ±0.01."""
    model = systems.get("P3", 1e-4, nu)
    states, outputs, inputs = _measured(model, 1, 600, spread=0.01)
    estimator = LSUCZ(model, Orthotope(-0.01 * np.ones(3), 0.01 * np.ones(3)))
    errors = []
    for x, y, u in zip(states, outputs, inputs, strict=True):
        estimator.update(y)
        errors.append(estimator.point - x)
        estimator.predict(u)
    assert np.sqrt(np.mean(np.square(errors[9:]))) <= 1.3e-4
