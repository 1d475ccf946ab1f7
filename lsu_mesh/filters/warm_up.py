"""Compile every kernel once, or load it from the cache, by doing a few steps of everything.

``python -m lsu_mesh.filters.warm_up`` does it at set-up, so that no process compiles anything later.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.filters.run import run_filter
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

STEPS = 4
OPTIONS: dict[str, tuple[dict[str, object], ...]] = {
    "LSUO": ({}, {"hull": "lp"}),
    "LSUP": tuple({"time_update": name} for name in ("image", "cgz", "edges", "strips")),
    "LSUCZ": ({"max_generators": 6, "max_constraints": 2}, {"point": "nearest"}),
    "ZonotopicKalman": ({}, {"form": "predictor"}),
}
"""Options whose code differs, by kind."""


def warm_up() -> float:
    """Run every filter for a few steps, with and without a noise map and a domain; the seconds that it took."""
    began = time.perf_counter()
    A, B, C = [[0.9, 0.2], [-0.1, 0.8]], [[0.1], [0.2]], [[1.0, 0.0], [1.0, 1.0]]
    prior = Orthotope([-1.0, -1.0], [1.0, 1.0])
    domain = Orthotope([-1.5, -1.5], [1.5, 1.5])
    for noise_map in (None, [[1.0], [0.5]]):
        model = LSUModel(A, B, C, 0.05, 0.1, noise_map=noise_map, domain=domain)
        data = simulate(model, STEPS, seed=1)
        for kind in FILTERS:
            for options in OPTIONS.get(kind, ({},)):
                engine = filter_class(kind)(model, prior, **options)  # type: ignore[call-arg]
                run_filter(engine, data.Y, data.U)
                _one_by_one(filter_class(kind)(model, prior, **options), data.Y, data.U)  # type: ignore[call-arg]
    return time.perf_counter() - began


def _one_by_one(engine: Filter, Y: np.ndarray, U: np.ndarray) -> None:
    for y, u in zip(Y, U, strict=True):
        engine.predict_output()
        engine.update(y)
        engine.condition(engine.support.interval_hull())
        engine.condition(engine.support)
        support = engine.support
        support.contains(support.center)
        support.support(np.ones(2))
        support.vertices()
        support.to_constrained_zonotope().bounds()
        engine.bounds()
        engine.predict(u)


if __name__ == "__main__":
    print(f"kernels ready after {warm_up():.1f} s", file=sys.stderr)
