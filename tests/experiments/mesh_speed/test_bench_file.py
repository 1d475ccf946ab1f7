"""Files of results: written and read back, and refused with a reason."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments.mesh_speed.bench_file import SCHEMA, BenchFile, read_bench_file

CASE = {"rate": 50.0, "filters": 4, "recorder": False, "p50_ratio": 2.5}
FILE = BenchFile("mesh", "0123abcd+", "2026-11-30T21:02:03Z", {"processor": "x", "cores": 2}, [CASE])


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / FILE.file_name
    path.write_text(FILE.text(), encoding="utf-8")
    assert read_bench_file(path) == FILE
    assert path.name == "20261130t2102-mesh-0123abcd.json"


def test_a_file_outside_of_git(tmp_path: Path) -> None:
    file = FILE._replace(commit=None)
    path = tmp_path / "x.json"
    path.write_text(file.text(), encoding="utf-8")
    assert read_bench_file(path).commit is None
    assert file.file_name.endswith("-unknown.json")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read: No such file"),
        ("{", "is no JSON; expected a file that lsu-mesh bench … --out wrote"),
        ("[]", f"expected the schema '{SCHEMA}', found None"),
        (json.dumps({"schema": "lsu-mesh bench 9"}), f"expected the schema '{SCHEMA}', found 'lsu-mesh bench 9'"),
        (json.dumps({"schema": SCHEMA, "what": "weather"}), "holds 'weather'; expected one of mesh, throughput"),
        (json.dumps({"schema": SCHEMA, "what": "mesh", "machine": {}, "cases": [{}]}), "its cases lack rate, filters"),
        (json.dumps({"schema": SCHEMA, "what": "mesh", "cases": []}), "its machine is missing"),
    ],
)
def test_other_files_are_refused_by_name(text: str | None, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=re.escape(words)) as refused:
        read_bench_file(path)
    assert str(path) in str(refused.value)


def test_the_history_of_this_repository_can_be_read(root: Path) -> None:
    for path in sorted((root / "benchmarks" / "history").glob("*.json")):
        file = read_bench_file(path)
        assert file.cases
        assert file.file_name == path.name
