"""``lsu-mesh validate --json``: one line per mistake and warning; one with counts where the file is fine."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.commands import validate
from lsu_mesh_services.exit_codes import OK, USAGE

FIELDS = {"level", "file", "table", "key", "found", "expected", "nearest", "line", "text", "source"}


def told(
    capsys: pytest.CaptureFixture[str], file: Path, *overrides: str, as_json: bool = True
) -> tuple[int, list[str], list[str]]:
    code = validate.main(argparse.Namespace(file=str(file), overrides=list(overrides), json=as_json))
    out = capsys.readouterr()
    return code, out.out.splitlines(), out.err.splitlines()


def test_each_mistake_is_a_line_with_its_fields(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    code, lines, words = told(capsys, demo, "filters.box.meet=no", "filters.para.kind=LSUQ", "mesh.dt=-1")
    found: list[dict[str, Any]] = [json.loads(line) for line in lines]
    assert (code, words) == (USAGE, [])
    assert all(set(one) == FIELDS and one["level"] == "mistake" for one in found)
    assert {(one["table"], one["key"], one["found"]) for one in found} == {
        ("filters.box", "meet", '"no"'), ("filters.para", "kind", '"LSUQ"'), ("mesh", "dt", "-1"),
    }  # fmt: skip
    assert {one["source"] for one in found} >= {"-X filters.box.meet=no", "-X mesh.dt=-1"}


def test_a_file_that_is_fine_is_one_line_with_counts(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    code, lines, words = told(capsys, demo)
    (found,) = [json.loads(line) for line in lines]
    assert (code, words) == (OK, [])
    assert found == {
        "level": "fine", "file": str(demo), "mesh": "demo", "states": 3, "mistakes": 0, "warnings": 0,
        "files": {}, "peers": {"filter": 3, "fusion": 1, "plant": 1, "recorder": 1, "sensor": 3},
    }  # fmt: skip


def test_warnings_are_lines_before_it(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    overrides = ('fusion.main.policy="relaxed"', "fusion.main.faults=1", "network.tls.enabled=true")
    code, lines, words = told(capsys, demo, *overrides)
    *warnings, fine = [json.loads(line) for line in lines]
    assert (code, words) == (OK, [])
    assert [(one["level"], one["table"], one["key"]) for one in warnings] == [
        ("warning", "fusion.main", "faults"), ("warning", "fusion.main", "faults"),
        ("warning", "network.tls", "authority"),
    ]  # fmt: skip
    assert all(set(one) == FIELDS for one in warnings)
    assert (fine["level"], fine["warnings"]) == ("fine", 3)


def test_people_get_the_same_as_words_on_stderr(capsys: pytest.CaptureFixture[str], demo: Path) -> None:
    code, lines, words = told(capsys, demo, "network.tls.enabled=true", as_json=False)
    assert (code, lines) == (OK, [])
    assert f"{demo}: warning: [network.tls] authority: there is no " in words[0]
    assert "fine; mesh 'demo' with 9 peers" in words[1]
    code, lines, words = told(capsys, demo, "filters.box.meet=no", as_json=False)
    assert (code, lines, words[-1]) == (USAGE, [], "1 mistake; nothing was started")
