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
OUTDATED: dict[str, dict[str, int]] = {
    "demo": {"LSUP algorithm 1, this is 3": 120, "intersect algorithm 1, this is 4": 60},
    "transfer": {
        "LSUCZ algorithm 1, this is 4": 2,
        "LSUP algorithm 1, this is 3": 120,
        "intersect algorithm 1, this is 4": 60,
    },
    "liar": {"relaxed algorithm 1, this is 4": 73},
    "learning": {"LSUCZ algorithm 1, this is 3": 8, "intersect algorithm 1, this is 4": 107},
    "every_option": {
        "LSUP algorithm 1, this is 3": 120,
        "ZonotopicKalman algorithm 1, this is 2": 119,
        "intersect algorithm 1, this is 4": 60,
    },
}
"""Sets whose filter has other bits today, which is said and is no failure."""


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "tests" / "data" / "recordings-0.1"


@pytest.mark.parametrize("name", SETS)
def test_a_recording_of_version_0_1_verifies_bit_by_bit_where_the_bits_are_the_same(
    folder: Path, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{name}.rrd"
    path.write_bytes(lzma.decompress((folder / f"{name}.rrd.xz").read_bytes()))
    assert main(["replay", str(path), "--verify", "--json"]) == OK
    (found,) = [
        line for line in map(json.loads, capsys.readouterr().out.splitlines()) if line["type"] == "verification"
    ]
    outdated = OUTDATED.get(name, {})
    assert found["outdated"] == outdated
    assert found["unverifiable"] == sum(outdated.values())
    assert found["exact"] == SETS[name] - sum(outdated.values())
    assert found["different"] == found["miss_truth"] == 0


def test_every_recording_in_the_folder_is_verified(folder: Path) -> None:
    assert {path.name for path in folder.glob("*.xz")} == {f"{name}.rrd.xz" for name in SETS}
