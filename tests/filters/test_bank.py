"""What a bank tells of some of its instances, and how they start again: as single filters do."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUO, LSUP, LSUPB, FilterBank, Orthotope, systems
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.compiled import CompiledFilter

N = 5


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB])
def test_some_instances_are_those_of_single_filters_after_a_contradiction_and_a_reset(
    kind: type[CompiledFilter],
) -> None:
    model = systems.get("S1").replace(B=None)
    n, m = model.state_count, model.output_count
    prior, domain = Orthotope([-5.0] * n, [5.0] * n), Orthotope([-50.0] * n, [50.0] * n)
    bank, singles = FilterBank(kind, model, [prior] * N), [kind(model, prior) for _ in range(N)]  # type: ignore[call-arg]
    rng = np.random.default_rng(2)
    for k in range(8):
        Y = rng.uniform(-0.1, 0.1, (N, m))
        Y[3] = 1e3 if k == 4 else Y[3]
        agreed = bank.update(Y)
        for i, single in enumerate(singles):
            try:
                single.update(Y[i])
            except InconsistentData:
                assert (i, k) == (3, 4)
                assert not agreed[3]
        if k == 5:
            bank.reset([1, 4], domain)
            singles[1].reset(domain)
            singles[4].reset(domain)
        points, lower, upper = bank.estimates([4, 3, 1])
        for row, i in enumerate([4, 3, 1]):
            assert points[row].tobytes() == singles[i].point.tobytes()
            assert (lower[row].tobytes(), upper[row].tobytes()) == tuple(b.tobytes() for b in singles[i].bounds())
        bank.predict()
        for single in singles:
            single.predict()
    assert bank.point_rule == "mean"
    assert [part.shape for part in bank.estimates([])] == [(0, n)] * 3
