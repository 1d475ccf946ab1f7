"""Hulls beside the exact ones: on published benchmarks where they are at hand, and on one whose answer is known."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from lsu_mesh import LSUO, LSUModel, ModelError, Orthotope
from lsu_mesh.experiments.tightness import FILTERS, Benchmark, Tightness, measure, read_benchmark

FOLDER = Path(os.environ.get("LSU_MESH_BENCHMARKS", Path(__file__).parents[2].parent / "shared" / "benchmarks"))
ROUNDING = 1e-9
PUBLISHED = ["twodim", "vehicle2", "pedestrian4"]


@pytest.fixture(scope="module")
def found() -> dict[str, tuple[Benchmark, dict[str, Tightness]]]:
    """Every filter on every benchmark that is there."""
    benchmarks = [read_benchmark(FOLDER / f"{name}.json") for name in PUBLISHED if (FOLDER / f"{name}.json").exists()]
    if not benchmarks:
        pytest.skip(f"there are no benchmarks in {FOLDER}")
    return {one.name: (one, {row.filter: row for row in measure(one, FILTERS)}) for one in benchmarks}


@pytest.mark.parametrize("name", PUBLISHED)
def test_no_hull_cuts_into_the_exact_one(found: dict[str, Any], name: str) -> None:
    benchmark, rows = found[name]
    assert len(rows) >= 9
    assert benchmark.last in benchmark.exact
    assert all(row.cut_off <= ROUNDING and row.mean_ratio >= 1.0 - ROUNDING for row in rows.values())


@pytest.mark.parametrize("name", ["twodim", "vehicle2"])
def test_without_reduction_the_hull_is_exact_at_every_step(found: dict[str, Any], name: str) -> None:
    benchmark, rows = found[name]
    assert set(benchmark.exact) == set(range(benchmark.last + 1))
    assert rows["LSUCZ unreduced"].excess <= ROUNDING
    assert rows["LSUO"].excess > 1e-3  # the measure can tell


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("own", ["LSUPB", "LSUCZ(20, 8)"])
def test_they_beat_every_published_estimator_that_is_no_constrained_zonotope(
    found: dict[str, Any], name: str, own: str
) -> None:
    benchmark, rows = found[name]
    others = [ratio for kind, ratio in benchmark.published.items() if not kind.startswith("CZN")]
    assert len(others) >= 10
    assert rows[own].mean_ratio < min(others)


@pytest.fixture
def interval(tmp_path: Path) -> Path:
    """x⁺ = x + w, |w| ≤ 1, |x₁| ≤ 1, |y − x| ≤ 2: without useful data the exact hull grows by 1 a step."""
    segment = {"center": [0.0], "generators": [[1.0]]}
    path = tmp_path / "interval.json"
    path.write_text(
        json.dumps(
            {
                "system": {
                    "A": [[1.0]], "B": [[1.0]], "C": [[1.0]], "R0": segment, "W": segment,
                    "V": {"center": [0.0], "generators": [[20.0]]}, "y": [[0.0, 0.5, 0.0]], "u": [[0.5, 0.0, 0.0]],
                },
                "exact_hulls": {"0": {"lo": [-1.0], "hi": [1.0]}, "2": {"lo": [-2.5], "hi": [3.5]}},
                "tightness": {"k": 2, "estimators": {"someone": {"mean_ratio": 1.5}}},
            }
        )
    )  # fmt: skip
    return path


def test_a_known_interval(interval: Path) -> None:
    benchmark = read_benchmark(interval)
    for row in measure(benchmark, FILTERS):
        assert row.cut_off <= 0.0
        if row.filter != "ZonotopicKalman(15)":  # its gain trades width for squares
            assert row.mean_ratio == pytest.approx(1.0, abs=1e-12)
            assert row.excess < 1e-12


def test_a_hull_that_cuts_off_one_side_is_seen(interval: Path) -> None:
    def shifted(model: LSUModel, prior: Orthotope) -> LSUO:
        assert model.B is not None
        return LSUO(model.replace(B=model.B * (1 + 1e-6)), prior)

    assert measure(read_benchmark(interval), {"shifted": shifted})[0].cut_off > 1e-7


def test_the_command_prints_own_filters_and_published_estimators(lsu_mesh_command: list[str], interval: Path) -> None:
    done = subprocess.run(
        [*lsu_mesh_command, "bench", "tightness", "--benchmarks", str(interval)], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert "LSUCZ(20, 8)" in done.stdout
    assert "published: someone" in done.stdout
    printed = subprocess.run(
        [*lsu_mesh_command, "bench", "tightness", "--json", "--benchmarks", str(interval)],
        capture_output=True,
        text=True,
        check=True,
    )
    report = json.loads(printed.stdout)
    assert {row["filter"] for row in report["own"]} == set(FILTERS)
    assert report["published"] == {"someone": 1.5}


def test_what_is_no_benchmark_is_named(tmp_path: Path, lsu_mesh_command: list[str]) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text("{}")
    with pytest.raises(ModelError, match=r"wrong\.json is no benchmark: KeyError\('system'\)"):
        read_benchmark(wrong)
    wrong.write_text("no")
    with pytest.raises(ModelError, match="is not JSON"):
        read_benchmark(wrong)
    with pytest.raises(ModelError, match="No such file"):
        read_benchmark(tmp_path / "absent.json")
    assert subprocess.run([*lsu_mesh_command, "bench", "tightness"], capture_output=True).returncode == 2
