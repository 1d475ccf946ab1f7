"""``lsu-mesh bench throughput`` prints a line for each rate, and says which demands are met."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands.bench_throughput import print_table
from lsu_mesh_services.exit_codes import OK, USAGE

from lsu_mesh.experiments.mesh_speed.bench_file import read_bench_file
from lsu_mesh.experiments.mesh_speed.throughput import Throughput


def test_lines_and_file_are_alike(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "t.json"
    assert main(["bench", "throughput", "--quick", "--json", "--out", str(target)]) == OK
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines == list(read_bench_file(target).cases)
    assert lines[-1]["what"] == "queue a message and take it"
    assert {line["type"] for line in lines} == {"throughput"}


def test_met_and_not_met(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([Throughput("a", 7000.0, 8000.0, 6000.0), Throughput("b", 1.0, 2.0, 6000.0)])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["a", "7,000", "8,000", "≥", "6,000", "met"] in lines
    assert ["b", "1", "2", "≥", "6,000", "not", "met"] in lines


def test_where_results_cannot_be_kept(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "throughput", "--out", "no/such.json"]) == USAGE
    assert capsys.readouterr().err == "bench throughput: --out no/such.json: there is no folder no\n"
