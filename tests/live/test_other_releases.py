"""Sensors of a later and of the first release, a filter and a recorder of this one: one mesh, one recording."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.recording.read import read_recording
from waiting import until

from lsu_mesh.mesh.messages import Measurement

Start = Callable[..., Any]
STEPS = 40
TRUTH = 0.3
MESH = """
[mesh]
name = "mixed"
dt = 0.02
[model]
A = [[1.0]]
rho = [0.001]
[model.prior]
lower = [-1.0]
upper = [1.0]
[plant]
[sensors.s1]
C = [[1.0]]
r = [0.1]
[sensors.s2]
C = [[1.0]]
r = [0.1]
[filters.f]
kind = "LSUO"
sensors = ["s1", "s2"]
"""


@pytest.mark.live
def test_peers_of_other_releases_work_together_live_and_in_the_recording(
    start: Start, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mesh.toml").write_text(MESH)
    began = time.time_ns()
    recorder = start("recorder", "-c", "mesh.toml", "--record", "mixed.rrd", "-l", "{endpoint}")
    at = recorder.endpoint
    estimator = start("filter", "f", "-c", "mesh.toml", "-e", at, endpoint=at)
    command = [sys.executable, str(root / "tests" / "plain_sensors.py"), at, "mixed", "f", str(STEPS)]
    with subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as sensors:
        assert sensors.stdout is not None
        model, *posteriors = [json.loads(sensors.stdout.readline()) for _ in range(STEPS + 1)]
        peers = {peer["name"]: peer for peer in looked(start, at)}
        sensors.communicate("enough\n", timeout=30)
    assert (model["A"], sorted(model["sensors"])) == ([[1.0]], ["s1", "s2"])
    assert [posterior["step"] for posterior in posteriors] == list(range(1, STEPS + 1))
    for posterior in posteriors:
        assert (posterior["status"], posterior["missing"]) == ("ok", [])
        assert posterior["lower"][0] <= TRUTH <= posterior["upper"][0]
    for name in ("f", "recorder"):
        counters = peers[name]["counters"]
        assert counters["unknown fields"] == counters["unknown fields.measurement.colour"] == STEPS
        assert not [count for count in counters if count.startswith("refused")]
        assert peers[name]["host"] == socket.gethostname()
        assert began < peers[name]["started_ns"] < time.time_ns()
    for session in (estimator, recorder):
        session.process.send_signal(signal.SIGINT)
        assert session.wait() == 0, session.output[1]
    recorded(tmp_path / "mixed.rrd", capsys)


def looked(start: Start, at: str) -> list[dict[str, Any]]:
    """What ``lsu-mesh health`` tells, once the filter's next heartbeat has come."""
    found: list[list[dict[str, Any]]] = []

    def is_told() -> bool:
        session = start("health", "-c", "mesh.toml", "--json", "-e", at, endpoint=at)
        session.wait()
        found.append([json.loads(line) for line in session.output[0].splitlines()])
        counts = [peer["counters"].get("unknown fields", 0) for peer in found[-1] if peer["name"] in ("f", "recorder")]
        return counts == [STEPS, STEPS]

    until(is_told, "both tell of the unknown fields", timeout=60.0)
    return found[-1]


def recorded(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The recording holds every field that came, and its sets are what the messages give."""
    recording = read_recording(path)
    assert recording.damaged == []
    assert recording.unknown_fields == {"measurement.colour": STEPS}
    measured = [one for one in recording.received if isinstance(one.message, Measurement)]
    assert {one.message.name: b"colour" in one.payload for one in measured} == {"s1": True, "s2": False}
    assert len(measured) == 2 * STEPS
    capsys.readouterr()
    assert main(["replay", str(path), "--verify", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert summary["exact"] >= STEPS - 1
    assert summary["different"] == summary["unverifiable"] == 0
