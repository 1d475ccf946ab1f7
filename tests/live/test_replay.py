"""Recordings of real runs: verified after kills of a filter and of the recorder, and played live."""

from __future__ import annotations

import functools
import signal
from pathlib import Path

import msgpack
import numpy as np
import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.read import RawMessage, read_raw, read_recording
from recorded_mesh import record
from waiting import until

from lsu_mesh.mesh.config import load

pytestmark = pytest.mark.live

until_recorded = functools.partial(until, what="the recorder has written it", timeout=120, pause=0.2)


@pytest.mark.timeout(900)  # all that it waits for, where each takes as long as it may
def test_a_run_in_which_a_filter_and_the_recorder_are_killed_is_exact(start_run, start) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--steps", "100000", "--record", "killed.rrd")
    first, second = session.folder / "killed.rrd", session.folder / "killed.part2.rrd"
    until_recorded(lambda: count(first, "fused/main") >= 20)
    session.child("recorder recorder").kill()
    session.child("filter box").kill()
    everyone = ("fused/main", "posterior/box", "posterior/para", "posterior/cz")
    until_recorded(lambda: min(count(second, ending) for ending in everyone) >= 80)
    until_recorded(lambda: boots_of(second, "filter/box") - boots_of(first, "filter/box"))
    session.process.send_signal(signal.SIGINT)
    assert session.wait() == 0, session.output[1]
    assert list(parts(first)) == [first, second]
    verification = start("replay", "killed.rrd", "--verify", "--json")
    assert verification.wait(200) == 0, verification.output
    (summary,) = verification.of("verification")
    assert summary["different"] == summary["miss_truth"] == 0
    assert summary["exact"] >= 7 * 70, "of four estimators, three of which publish two sets a step"


def count(recording: Path, ending: str) -> int:
    """How many messages of a key are in the file so far."""
    return sum(message.key.endswith(ending) for message in messages(recording))


def boots_of(recording: Path, source: str) -> set[str]:
    """The process starts of a peer that the file knows."""
    topic = source.replace("filter/", "posterior/")
    payloads = (message.payload for message in messages(recording) if message.key.endswith(topic))
    return {msgpack.unpackb(payload)["boot"] for payload in payloads}


def messages(recording: Path) -> list[RawMessage]:
    """What the file holds so far."""
    try:
        return read_raw(recording)
    except (FileNotFoundError, ValueError):
        return []  # not there yet, or its first bytes are not


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
    pace = np.median(np.diff([one.arrival_ns for one in played]))
    assert pace == pytest.approx(20e6, rel=0.3), "the recorded pace"
