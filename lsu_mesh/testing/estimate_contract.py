"""What a filter with ``guarantee = "none"`` promises: usable numbers, and a state that only true steps change."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from lsu_mesh.filters.filter import Filter
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.testing.filter_state import Witness

DOMAIN = 100.0
COPIES = 5
"""How often the same set is transferred again."""
SHARE = 0.7
"""Of the width of the filter's bounds, above the lower ones, that is transferred to it."""


def check_estimates(make: Callable[[LSUModel, Orthotope], Filter], seeds: Iterable[int], steps: int) -> None:
    """Shapes, finite numbers, snapshots bit by bit, and the state kept after errors; the model has a domain."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        n, m = int(rng.integers(1, 5)), int(rng.integers(1, 4))
        A = rng.normal(size=(n, n))
        A *= 0.8 / max(1e-9, np.abs(np.linalg.eigvals(A)).max())
        B = rng.normal(size=(n, 1)) if seed % 2 else None
        domain = Orthotope([-DOMAIN] * n, [DOMAIN] * n)
        model = LSUModel(A=A, B=B, C=rng.normal(size=(m, n)), rho=0.1, r=0.2, domain=domain)
        filter = make(model, Orthotope([-1.0] * n, [1.0] * n))
        witness = Witness(filter, f"{type(filter).__name__}, an estimate with {n} states, seed {seed}")
        data = simulate(model, steps, seed, x1=np.zeros(n))
        for k in range(steps):
            witness.step = k + 1
            y = np.where(rng.random(m) < 0.2, np.nan, data.Y[k])
            _check_step(filter, witness, y, None if B is None else data.U[k])


def _check_step(filter: Filter, witness: Witness, y: np.ndarray, u: np.ndarray | None) -> None:
    witness.action = "before update"
    witness.check_shapes(filter.support)
    witness.check_errors_keep_the_state(None, must_contradict=False)
    witness.check_snapshot(lambda: filter.update(y))
    witness.action = "update"
    filter.update(y)
    witness.check_shapes(filter.support)
    witness.check_volume()
    witness.action = "condition"
    other = _part_of(filter)
    gain = filter.condition(other)
    witness.expect(gain >= 0.0, f"the gain {gain}", "a number of nats, not negative")
    witness.check_shapes(filter.support)
    witness.check_copies(lambda: filter.condition(other), COPIES, lambda: filter.predict(u))
    witness.action = "predict"
    witness.check_snapshot(lambda: filter.predict(u))
    filter.predict(u)
    witness.check_shapes(filter.support)


def _part_of(filter: Filter) -> Orthotope:
    """A box that cuts each side of the filter's bounds."""
    lower, upper = filter.bounds()
    return Orthotope(lower, lower + SHARE * (upper - lower))
