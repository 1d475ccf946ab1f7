"""Which cases are measured."""

from __future__ import annotations

import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.mesh_speed.mesh_case import GRID, MeshCase, cases


def test_every_rate_with_every_number_of_filters() -> None:
    found = cases([10.0, 1000.0], [1, 12], recorder=True)
    assert found == [MeshCase(rate, count, True) for rate in (10.0, 1000.0) for count in (1, 12)]


def test_the_grid_where_nothing_is_asked_for() -> None:
    assert cases([], [], recorder=False) == list(GRID)
    assert [case.recorder for case in cases([], [], recorder=True)] == [True] * len(GRID)
    assert cases([200.0], [], recorder=False) == [MeshCase(200.0, GRID[0].filters)]


@pytest.mark.parametrize(
    ("rates", "filters", "words"),
    [
        ([9.0], [], "--rate 9: expected 10 to 1000 Hz"),
        ([1001.0], [], "--rate 1001: expected 10 to 1000 Hz"),
        ([float("nan")], [], "--rate nan"),
        ([], [0], "--filters 0: expected 1 to 12 filters"),
        ([], [13], "--filters 13: expected 1 to 12 filters"),
    ],
)
def test_cases_outside_of_the_limits(rates: list[float], filters: list[int], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        cases(rates, filters, recorder=False)


def test_words() -> None:
    assert MeshCase(50.0, 1).words == "50 Hz, 1 filter"
    assert MeshCase(12.5, 4, True).words == "12.5 Hz, 4 filters, recorder"
