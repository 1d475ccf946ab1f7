"""Ratios of mesh and relay from the samples of all turns."""

from __future__ import annotations

import json

import pytest

from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS
from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.mesh_report import MeshReport, Turn, keeps_up, processor_ms_per_step

RELAY = [Turn([1.0, 1.0, 2.0, 10.0], 0, 0, 0.004), Turn([1.0, 1.0, 1.0, 1.0], 0, 0, 0.004)]
MESH = [Turn([2.0, 2.0, 2.0, 30.0], 1, 2, 0.02), Turn([4.0, 4.0, 4.0, 4.0], 0, 1, 0.012)]


def test_the_line_of_a_case() -> None:
    line = json.loads(json.dumps(MeshReport(MeshCase(50.0, 4), RELAY, MESH).line()))
    assert {name: line[name] for name in ("type", "rate", "filters", "recorder", "turns", "steps")} == {
        "type": "mesh", "rate": 50.0, "filters": 4, "recorder": False, "turns": 2, "steps": 8,
    }  # fmt: skip
    assert line["p50_ratio"] == 4.0, "the fourth of 2 2 2 4 4 4 4 30, beside 1"
    assert line["p99_ratio"] == line["p999_ratio"] == 3.0, "the largest of each"
    assert (line["p50_ratio_least"], line["p50_ratio_most"]) == (2.0, 4.0)
    assert (line["cpu_ms_per_step"], line["relay_cpu_ms_per_step"], line["cpu_ratio"]) == (4.0, 1.0, 4.0)
    assert (line["mesh"]["missing"], line["mesh"]["incomplete"]) == (1, 3)
    assert line["relay"]["largest_ms"] == 10.0


def test_the_line_has_what_is_compared() -> None:
    line = MeshReport(MeshCase(50.0, 4), RELAY, MESH).line()
    assert set(KINDS["mesh"].keys) | set(KINDS["mesh"].lower_is_better) <= set(line)


def test_a_system_without_processor_times() -> None:
    turns = [RELAY[0], RELAY[1]._replace(processor_s=None)]
    assert processor_ms_per_step(turns) is None
    line = MeshReport(MeshCase(50.0, 4), turns, MESH).line()
    assert (line["cpu_ratio"], line["relay_cpu_ms_per_step"]) == (None, None)
    assert line["cpu_ms_per_step"] == pytest.approx(4.0)


def test_one_step_in_a_hundred_may_be_lost() -> None:
    assert keeps_up(1, 100)
    assert not keeps_up(2, 100)
