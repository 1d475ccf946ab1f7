"""What ``lsu-mesh bench mesh`` refuses before it starts anything, and its table."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands.bench_mesh import print_table, too_busy
from lsu_mesh_services.exit_codes import USAGE

from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.mesh_report import MeshReport, Turn


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rate", "5"], "--rate 5: expected 10 to 1000 Hz"),
        (["--filters", "13"], "--filters 13: expected 1 to 12 filters"),
        (["--seconds", "0"], "--seconds 0: expected 1 to 600"),
        (["--turns", "0"], "--turns 0: expected 1 to 100"),
        (["--tree", "nowhere"], "--tree nowhere: is no checkout of lsu-mesh; there is no lsu_mesh/__init__.py"),
        (["--save"], "--save writes into benchmarks/history of the repository: run it there, or give --out FILE"),
        (["--out", "no/such.json"], "--out no/such.json: there is no folder no"),
        (["--out", "."], "--out .: is a folder; give the name of a file"),
    ],
)
def test_what_cannot_be_measured_or_kept(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "mesh", *arguments]) == USAGE
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"bench mesh: {words}\n")


def test_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    relay, mesh = Turn([1.0, 2.0], 0, 0, 0.004), Turn([2.0, 6.0], 1, 0, 0.02)
    print_table([MeshReport(MeshCase(50.0, 4), [relay], [mesh]).line()])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["rate", "50,", "filters", "4", "p50", "1", "2", "2"] in lines
    assert ["p99.9", "2", "6", "3"] in lines
    assert ["processor", "a", "step", "2", "10", "5"] in lines
    assert lines[-1][-6:] == ["relay's;", "fused", "sets:", "mesh", "missing", "1"]


def test_a_mesh_that_does_not_keep_up_is_told_of() -> None:
    relay, mesh = Turn([1.0] * 100, 1, 0, 0.004), Turn([1.0] * 100, 1, 0, 0.02)
    assert too_busy(MeshReport(MeshCase(50.0, 4), [relay], [mesh]).line()) == ""
    words = too_busy(MeshReport(MeshCase(50.0, 4), [relay], [mesh._replace(missing=2)]).line())
    assert words.startswith("the mesh (2 of 100 fused sets missing) did not keep up")
