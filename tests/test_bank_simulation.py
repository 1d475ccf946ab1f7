"""Many plants at once are the same plants, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUModel
from lsu_mesh.bank_simulation import BankDynamics, measured_rows
from lsu_mesh.simulation import measure, next_state


def models(count: int, **parts: object) -> list[LSUModel]:
    """Random models of one structure."""
    rng = np.random.default_rng(3)
    return [
        LSUModel(A=rng.normal(size=(3, 3)), B=None, C=[], rho=rng.uniform(0.0, 0.2, 3), r=[], **parts)  # type: ignore[arg-type]
        for _ in range(count)
    ]


@pytest.mark.parametrize("parts", [{}, {"a": [0.1, -0.2, 0.3]}, {"noise_map": np.tri(3)}])
@pytest.mark.parametrize("is_shared", [False, True])
def test_states_are_those_of_single_plants(parts: dict[str, object], is_shared: bool) -> None:
    listed = models(1 if is_shared else 40, **parts)
    rng = np.random.default_rng(4)
    X, unit = 1e3 * rng.normal(size=(40, 3)), rng.uniform(-1.0, 1.0, (40, 3))
    found = BankDynamics(listed).next_states(X, unit)
    for i in range(40):
        single = next_state(listed[i % len(listed)], X[i], np.zeros(0), unit[i])
        assert found[i].tobytes() == single.tobytes()


def test_measurements_are_those_of_single_sensors() -> None:
    rng = np.random.default_rng(6)
    C, r = rng.normal(size=(2, 3)), np.array([0.3, 0.0])
    X, unit = 1e6 * rng.normal(size=(40, 3)), rng.uniform(-1.0, 1.0, (40, 2))
    found = measured_rows(C, r, X, unit)
    for i in range(40):
        assert found[i].tobytes() == measure(C, r, X[i], unit[i]).tobytes()
