"""``lsu-mesh bench scale`` without processes, and its page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands.bench_scale import print_table
from lsu_mesh_services.exit_codes import OK, USAGE

from lsu_mesh.experiments.mesh_speed.bench_file import read_bench_file
from lsu_mesh.experiments.mesh_speed.scale import Cost


def test_lines_file_and_page_come_from_one_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, page = tmp_path / "s.json", tmp_path / "scaling.md"
    arguments = ["--quick", "--no-processes", "--json", "--out", str(target), "--page", str(page)]
    assert main(["bench", "scale", *arguments]) == OK
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines == list(read_bench_file(target).cases)
    assert {line["type"] for line in lines} == {"scale"}
    assert page.read_text(encoding="utf-8").count("measured |") == len(lines)


def test_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([Cost("a", 1, 2.0, "µs"), Cost("a", 2, 8.0, "µs"), Cost("b", 5, 1.0, "ms")])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["a", "1", "2", "µs", "1"] in lines
    assert ["2", "8", "µs", "4"] in lines
    assert lines[-1][-2:] == ["a", "2.00"]


def test_where_the_page_cannot_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "scale", "--page", "no/such.md"]) == USAGE
    assert capsys.readouterr().err == "bench scale: --page no/such.md: there is no folder no\n"
