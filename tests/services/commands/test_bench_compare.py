"""``lsu-mesh bench compare`` prints ratios, or says why it cannot."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK, USAGE

from lsu_mesh.experiments.mesh_speed.bench_file import BenchFile

CASE = {"rate": 200.0, "filters": 4, "recorder": True}


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """Two results: the second is quicker and needs more of a processor."""
    made = []
    for name, numbers in (("a", {"p50_ratio": 4.0, "cpu_ratio": 2.0}), ("b", {"p50_ratio": 3.0, "cpu_ratio": 2.2})):
        path = tmp_path / f"{name}.json"
        file = BenchFile("mesh", name, "2026-11-30T00:00:00Z", {"processor": name}, [{**CASE, **numbers}])
        path.write_text(file.text(), encoding="utf-8")
        made.append(str(path))
    return made


def test_the_table_holds_ratios_and_no_times(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "compare", *files]) == OK
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["rate", "200,", "filters", "4,", "recorder", "p50_ratio", "0.75", "better"] in lines
    assert ["cpu_ratio", "1.1", "worse"] in lines
    assert ["the", "machines", "differ", "in", "processor:", "a", "and", "b"] in lines


def test_a_line_for_each_number(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "compare", "--json", *files]) == OK
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(line["measure"], line["ratio"], line["verdict"]) for line in lines] == [
        ("p50_ratio", 0.75, "better"),
        ("cpu_ratio", 1.1, "worse"),
    ]
    assert {(line["type"], line["what"]) for line in lines} == {("comparison", "mesh")}


def test_a_file_that_is_not_there(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "compare", files[0], files[1] + "x"]) == USAGE
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"bench compare: {files[1]}x: cannot be read: No such file or directory\n")
