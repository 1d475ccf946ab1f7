"""Work over several processes."""

from __future__ import annotations

import math

import pytest

from lsu_mesh.experiments.workers import part, spread


@pytest.mark.parametrize("processes", [1, 2])
def test_results_come_in_order_and_the_watch_reaches_the_end(processes: int) -> None:
    shares: list[float] = []
    assert spread(math.sqrt, [1.0, 4.0, 9.0], shares.append, processes) == [1.0, 2.0, 3.0]
    assert shares == pytest.approx([1 / 3, 2 / 3, 1.0])


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_in_a_process_is_raised_here(processes: int) -> None:
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        spread(math.sqrt, [1.0, -4.0], processes=processes)


def test_a_part_of_the_whole() -> None:
    shares: list[float] = []
    part(shares.append, 0.5, 0.75)(0.5)
    assert shares == [0.625]
