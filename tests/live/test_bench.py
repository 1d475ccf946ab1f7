"""``lsu-mesh bench`` with real processes."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from lsu_mesh_services.exit_codes import OK

from lsu_mesh.experiments.mesh_speed.bench_file import read_bench_file

pytestmark = pytest.mark.live


def test_a_short_case_beside_its_relay(lsu_mesh_command: list[str], root: Path, tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    arguments = ["--rate", "20", "--filters", "2", "--seconds", "3", "--turns", "1", "--json", "--out", str(target)]
    command = [*lsu_mesh_command, "bench", "mesh", *arguments, "--tree", str(root)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=250)
    assert done.returncode == OK, done.stderr
    (line,) = (json.loads(text) for text in done.stdout.splitlines())
    assert (line["type"], line["rate"], line["filters"], line["recorder"]) == ("mesh", 20.0, 2, False)
    assert line["steps"] == 60
    assert line["relay"]["missing"] == 0, "the relay computes nothing"
    assert line["p50_ratio"] > 1, "the mesh does all that the relay does, and its work"
    assert line["cpu_ms_per_step"] > line["relay_cpu_ms_per_step"] > 0
    for side in ("relay", "mesh"):
        assert 0 < line[side]["p50_ms"] <= line[side]["p99_ms"] <= line[side]["p999_ms"] <= line[side]["largest_ms"]
    file = read_bench_file(target)
    assert (file.what, list(file.cases)) == ("mesh", [line])
    assert str(root) not in target.read_text(encoding="utf-8"), "no path of the machine"


def test_a_start_is_timed_and_its_memory_is_read(lsu_mesh_command: list[str]) -> None:
    command = [*lsu_mesh_command, "bench", "start", "--turns", "1", "--seconds", "0.5", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=250)
    assert done.returncode == OK, done.stderr
    lines = {line["what"]: line for line in map(json.loads, done.stdout.splitlines())}
    assert 0 < lines["all peers linked"]["seconds"] < lines["first fused set"]["seconds"]
    assert lines["first fused set"]["processor_s"] > 0
    for role in ("plant", "sensor", "filter", "fusion"):
        assert 20 < lines[role]["rss_mib"] < 2000
