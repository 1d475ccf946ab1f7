"""Without options every filter serves models of any size."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUModel, Orthotope, ZonotopicKalman, run_filter, simulate
from lsu_mesh.filters.filter import Filter


def chain(n: int) -> LSUModel:
    A = 0.8 * np.eye(n) + 0.1 * np.eye(n, k=1)
    return LSUModel(A, None, np.eye(n)[::4], 0.05, 0.2)


@pytest.mark.parametrize(("kind", "least"), [(LSUCZ, 20), (ZonotopicKalman, 15)])
@pytest.mark.parametrize("n", [1, 6, 8, 16, 22])
def test_the_complexity_grows_with_the_states(kind: Callable[..., Filter], least: int, n: int) -> None:
    model, prior = chain(n), Orthotope([-1.0] * n, [1.0] * n)
    data = simulate(model, 6, seed=n)
    usual, stated, all_kept = (
        kind(model, prior),
        kind(model, prior, max(least, 3 * n)),
        kind(model, prior, reduce=False),
    )
    usual_run, stated_run = run_filter(usual, data.Y), run_filter(stated, data.Y)
    np.testing.assert_array_equal(usual_run.lower, stated_run.lower)
    assert ((usual_run.lower <= data.X) & (usual_run.upper >= data.X)).all()
    run_filter(all_kept, data.Y)
    assert all_kept.support.generators.shape[1] >= usual.support.generators.shape[1]
