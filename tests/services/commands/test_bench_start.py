"""What ``lsu-mesh bench start`` refuses, and its tables."""

from __future__ import annotations

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands.bench_start import print_table
from lsu_mesh_services.exit_codes import USAGE

from lsu_mesh.experiments.mesh_speed.start_report import Start, start_lines


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seconds", "-1"], "--seconds -1: expected 0 to 600"),
        (["--turns", "0"], "--turns 0: expected 1 to 100"),
        (["--tree", "nowhere"], "--tree nowhere: is no checkout of lsu-mesh; there is no lsu_mesh/__init__.py"),
        (["--out", "no/such.json"], "--out no/such.json: there is no folder no"),
    ],
)
def test_what_cannot_be_measured_or_kept(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "start", *arguments]) == USAGE
    assert capsys.readouterr() == ("", f"bench start: {words}\n")


def test_the_tables(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(start_lines([Start(1.25, 2.5, 3.0, {"sensor s1": 99.0, "plant plant": None})]))
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["all", "peers", "linked", "1.25"] in lines
    assert ["first", "fused", "set", "2.5", "3"] in lines
    assert ["sensor", "99"] in lines
    assert ["plant", "–"] in lines
