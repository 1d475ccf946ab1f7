"""Commands that know single targets only refuse a mesh of banks, with a remedy."""

from __future__ import annotations

from pathlib import Path

import pytest
from bank_mesh import write
from local_mesh import LocalMesh
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK, USAGE
from recorded_mesh import record

from lsu_mesh.mesh.config import load


@pytest.mark.parametrize(
    ("command", "remedy"),
    [
        (["simulate", "FILE", "--seeds", "1"], "leave out instances"),
        (["gateway", "-c", "FILE"], "lsu_mesh_services.client"),
        (["identify", "FILE"], "the data of one target"),
    ],
)
def test_a_mesh_of_banks_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str], remedy: str
) -> None:
    file = str(write(tmp_path))
    assert main([file if one == "FILE" else one for one in command]) == USAGE
    said = capsys.readouterr().err
    assert "its filters are banks of 12 targets" in said
    assert remedy in said


def test_a_recording_of_banks_is_verified_and_not_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = LocalMesh(load(write(tmp_path)))
    mesh.run(5.0)
    file = str(record(mesh, tmp_path / "banks.rrd"))
    assert main(["replay", file, "--verify"]) == OK
    said = capsys.readouterr().out
    assert "40 sets recomputed from their provenance" in said
    assert "480 sets of steps whose truth is recorded hold it" in said
    assert main(["replay", file]) == USAGE
    assert "use lsu-mesh replay FILE --verify" in capsys.readouterr().err
