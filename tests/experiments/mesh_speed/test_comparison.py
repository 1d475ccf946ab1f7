"""Two files of results side by side."""

from __future__ import annotations

import re
from typing import Any

import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.mesh_speed.bench_file import BenchFile
from lsu_mesh.experiments.mesh_speed.comparison import Row, compare_files, verdict


def mesh(*cases: dict[str, Any], cores: int = 2) -> BenchFile:
    return BenchFile("mesh", "a", "2026-11-30T00:00:00Z", {"processor": "x", "cores": cores}, cases)


def case(filters: int, **numbers: float | None) -> dict[str, Any]:
    return {"rate": 50.0, "filters": filters, "recorder": False, **numbers}


def test_every_number_that_both_have() -> None:
    a = mesh(case(4, p50_ratio=4.0, p99_ratio=2.0, cpu_ratio=None), case(1, p50_ratio=1.0))
    b = mesh(case(12, p50_ratio=9.0), case(4, p50_ratio=3.0, p99_ratio=2.5, cpu_ratio=2.0), cores=4)
    found = compare_files(a, b)
    assert found.rows == [
        Row("rate 50, filters 4", "p50_ratio", 0.75, "better"),
        Row("rate 50, filters 4", "p99_ratio", 1.25, "worse"),
    ]
    assert found.only_one == ["rate 50, filters 1", "rate 50, filters 12"]
    assert found.differs == ["cores: 2 and 4"]


@pytest.mark.parametrize(
    ("ratio", "lower_is_better", "word"),
    [(0.9, True, "better"), (1.1, True, "worse"), (0.9, False, "worse"), (1.1, False, "better"), (1.03, True, "same")],
)
def test_verdicts(ratio: float, lower_is_better: bool, word: str) -> None:
    assert verdict(ratio, lower_is_better) == word


def test_files_without_a_case_in_common() -> None:
    with pytest.raises(ModelError, match=re.escape("no case in common: rate 50, filters 1; rate 50, filters 2")):
        compare_files(mesh(case(1)), mesh(case(2)))
    with pytest.raises(ModelError, match="both are empty"):
        compare_files(mesh(), mesh())


def test_files_of_different_measurements() -> None:
    other = BenchFile("start", "b", "2026-11-30T00:00:00Z", {}, [])
    with pytest.raises(ModelError, match="first file holds 'mesh', the second 'start'"):
        compare_files(mesh(), other)
