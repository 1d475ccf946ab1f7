"""How tight LSU-CZ is on P3, against exact hulls."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUModel, Orthotope, systems


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
    prior = Orthotope(-np.ones(model.state_count), np.ones(model.state_count))
    estimator = LSUCZ(model, prior, *limits, reduce=bool(limits))
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
        exact = _widths(model, outputs, inputs)[5:]
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
