"""Models drawn at random, by a seed."""

from __future__ import annotations

import numpy as np

from lsu_mesh import LSUModel, Orthotope


def random_model(seed: int) -> LSUModel:
    """A stable model of 1–5 states, some of them without noise, some with exact outputs."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    A = rng.normal(size=(n, n))
    A *= rng.uniform(0.3, 1.0) / max(1e-9, np.abs(np.linalg.eigvals(A)).max())
    rho = rng.uniform(0.01, 0.2, n) * (rng.random(n) < 0.8)
    r = rng.uniform(0.01, 0.3, m) * (rng.random(m) < 0.95)
    return LSUModel(
        A, rng.normal(size=(n, 1)), rng.normal(size=(m, n)), rho=rho, r=r, domain=Orthotope([-100.0] * n, [100.0] * n)
    )
