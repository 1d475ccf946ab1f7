"""Modules that lie in the working folder are not imported, by no process of a mesh."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.live

DECOYS = (
    "services/__init__.py", "lsu_mesh/__init__.py", "lsu_mesh_services/__init__.py", "numpy.py", "zenoh.py",
    "rerun.py", "msgspec.py", "socket.py", "multiprocessing.py",
)  # fmt: skip
"""Modules of ours, of what we use, and of the standard library."""


@pytest.fixture
def decoys(tmp_path: Path) -> Path:
    """A folder where importing any of these ends the process, and leaves a trace."""
    for name in DECOYS:
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        trace = str(tmp_path / "imported")
        file.write_text(f"open({trace!r}, 'a').write({name + chr(10)!r})\nraise ImportError({name!r})\n")
    return tmp_path / "imported"


@pytest.mark.parametrize("how", ["module", "script"])
def test_a_mesh_runs_in_a_folder_that_holds_packages_of_the_same_names(start, decoys: Path, how: str) -> None:  # type: ignore[no-untyped-def]
    script = Path(sys.executable).with_name("lsu-mesh")
    if how == "script" and not script.exists():
        pytest.skip("lsu-mesh is not installed as a script")
    command = [str(script)] if how == "script" else []
    session = start(
        "run", "--json", "--steps", "40", "--record", "x.rrd", "-X", "network.entry={endpoint}", command=command
    )
    assert session.wait() == 0, session.output[1]
    assert {row["name"]: row["steps"] for row in session.of("estimator")}["main"] == 40
    for arguments in (
        ("recording", "repair", "x.rrd"),
        ("replay", "x.rrd", "--verify"),
        ("simulate", "--seeds", "6", "--steps", "10", "--workers", "2"),
    ):
        done = start(*arguments, command=command)
        assert done.wait() == 0, done.output[1]
    assert not decoys.exists(), decoys.read_text()
