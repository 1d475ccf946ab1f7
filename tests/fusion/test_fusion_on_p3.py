"""Fusion of one filter per output on P3: containment, what it gains, and what feedback of the fused box gives."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUP, Orthotope, fuse, systems
from lsu_mesh.filters.filter import Filter

OUTPUTS = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [1.0, -1.0, 0.3]])
MODEL = systems.get("P3", 0.1, 0.3)
START = 10


def _follow(
    kind: type[LSUCZ] | type[LSUP], feedback: bool, seed: int, steps: int
) -> tuple[list[float], list[list[float]]]:
    """Volume of the fused support relative to the best local one, and the local hull volumes, after the start."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, 3)
    filters: list[Filter] = [
        kind(MODEL.replace(C=OUTPUTS[i : i + 1], r=[0.3]), Orthotope([-1.0] * 3, [1.0] * 3)) for i in range(3)
    ]
    ratios, hulls = [], []
    for k in range(steps):
        for i, local in enumerate(filters):
            local.update(OUTPUTS[i : i + 1] @ x + rng.uniform(-0.3, 0.3, 1))
        fused = fuse([local.support for local in filters])
        lower, upper = fused.bounds
        assert (lower <= x).all()
        assert (x <= upper).all()
        assert fused.support.contains(x)
        if k >= START:
            ratios.append(fused.support.volume() / min(local.support.volume() for local in filters))
        for local in filters:
            if feedback:
                assert local.condition(Orthotope(lower, upper)) >= 0.0
        if k >= START:
            hulls.append([float(np.prod(np.subtract(*local.bounds()[::-1]))) for local in filters])
        u = rng.normal(size=1)
        for local in filters:
            local.predict(u)
        x = MODEL.A @ x + MODEL.B @ u + rng.uniform(-0.1, 0.1, 3)
    return ratios, hulls


def test_fused_parallelotopes_are_at_most_half_of_the_best() -> None:
    ratios = [ratio for seed in range(3) for ratio in _follow(LSUP, False, seed, 40)[0]]
    assert np.mean(ratios) <= 0.5


@pytest.mark.parametrize("seed", [0, 1])
def test_feedback_brings_every_local_hull_down(seed: int) -> None:
    _, hulls = _follow(LSUCZ, True, seed, 40)
    assert (np.mean(hulls, axis=0) <= 0.09).all()
