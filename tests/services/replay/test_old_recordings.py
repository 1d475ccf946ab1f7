"""What an earlier version recorded is read and verified, bit by bit."""

from __future__ import annotations

import json
import lzma
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK

SETS = {"demo": 420, "transfer": 420, "liar": 635, "learning": 990, "every_option": 780}
"""Published sets, by recording."""


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "tests" / "data" / "recordings-0.1"


@pytest.mark.parametrize("name", SETS)
def test_a_recording_of_version_0_1_verifies_bit_by_bit(
    folder: Path, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{name}.rrd"
    path.write_bytes(lzma.decompress((folder / f"{name}.rrd.xz").read_bytes()))
    assert main(["replay", str(path), "--verify", "--json"]) == OK
    (found,) = [
        line for line in map(json.loads, capsys.readouterr().out.splitlines()) if line["type"] == "verification"
    ]
    assert found["exact"] == SETS[name]
    assert found["different"] == found["unverifiable"] == found["miss_truth"] == 0


def test_every_recording_in_the_folder_is_verified(folder: Path) -> None:
    assert {path.name for path in folder.glob("*.xz")} == {f"{name}.rrd.xz" for name in SETS}
