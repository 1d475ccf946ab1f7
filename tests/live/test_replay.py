"""Recordings of real runs: verified after kills of a filter and of the recorder, and played live."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from local_mesh import LocalMesh
from recorded_mesh import record

from lsu_mesh.mesh.config import load
from services.recording.read import parts, read_raw, read_recording

pytestmark = pytest.mark.live


def test_a_run_in_which_a_filter_and_the_recorder_are_killed_is_exact(start_run, start) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--steps", "300", "--rate", "25", "--record", "killed.rrd")  # a loaded machine takes its time
    recording = session.folder / "killed.rrd"
    until_it_holds(recording, 20)
    session.child("recorder recorder").kill()
    session.child("filter box").kill()
    assert session.wait() == 0, session.output[1]
    assert [file.name for file in parts(recording)] == ["killed.rrd", "killed.part2.rrd"]
    boots = {one.message.boot for one in read_recording(recording).received if one.message.src == "filter/box"}
    assert len(boots) == 2
    verification = start("replay", "killed.rrd", "--verify", "--json")
    assert verification.wait() == 0, verification.output
    (summary,) = verification.of("verification")
    assert summary["different"] == summary["miss_truth"] == 0
    assert summary["exact"] > 1500, "publishers keep what the recorder missed"


def until_it_holds(recording: Path, sets: int) -> None:
    """Wait until so many fused sets are in the file."""
    end, found = time.monotonic() + 90, 0
    while found < sets:
        assert time.monotonic() < end, "the recorder writes nothing"
        time.sleep(0.1)
        if recording.exists() and recording.stat().st_size:
            found = sum("/fused/" in message.key for message in read_raw(recording))


def test_a_recording_is_played_to_peers_over_zenoh(start, tmp_path: Path, demo: Path) -> None:  # type: ignore[no-untyped-def]
    mesh = LocalMesh(load(demo, ["mesh.steps=100"]))
    mesh.run(2.5)
    recording = record(mesh, tmp_path / "demo.rrd")
    entry = ("-X", "network.entry={endpoint}")
    session = start("replay", str(recording), "--live", "--json", "--record", "live.rrd", *entry)
    assert session.wait() == 0, session.output[1]
    rows = {row["name"]: row for row in session.of("estimator")}
    assert {name: row["last_step"] for name, row in rows.items()} == dict.fromkeys(mesh.estimators(), 100)
    assert all(row["inside"] == 1.0 for row in rows.values())
    received = read_recording(session.folder / "live.rrd").received
    played = [one for one in received if "/measurement/s1" in one.key]
    pace = (played[-1].arrival_ns - played[0].arrival_ns) / (len(played) - 1)
    assert pace == pytest.approx(20e6, rel=0.2), "the recorded pace"
