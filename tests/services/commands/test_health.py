"""What ``lsu-mesh health`` and ``top`` print of a peer."""

from __future__ import annotations

import json

import pytest
from lsu_mesh_services.commands.health import print_json, print_table
from lsu_mesh_services.commands.top import Row, record

from lsu_mesh.mesh.observer import PeerHealth

COUNTERS = {"received": 9.0, "gaps": 0.0, "unknown fields": 4.0, "unknown fields.measurement.colour": 4.0}
PEER = PeerHealth("box", "filter", "OK", step=9, counters=COUNTERS, started_ns=5, host="lab-1")


def test_ignored_fields_are_named_below_the_table_and_change_no_level(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([PEER])
    out = capsys.readouterr().out
    assert "filter/box ignores fields of a newer peer: measurement.colour 4 times" in out
    assert "the mesh: OK" in out
    assert "refused" not in out.splitlines()[-2]


def test_programs_are_told_start_and_host(capsys: pytest.CaptureFixture[str]) -> None:
    print_json([PEER])
    told = json.loads(capsys.readouterr().out)
    assert (told["started_ns"], told["host"]) == (5, "lab-1")
    row = record(Row(PEER, 9, None, None))
    assert (row["started_ns"], row["host"]) == (5, "lab-1")
