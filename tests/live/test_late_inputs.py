"""Inputs that come late, live: the input box stands in for them, sets are made again, and the recording verifies."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.recording.read import Recording, read_recording

from lsu_mesh.mesh.messages import Fused, Posterior, Prediction

Start = Callable[..., Any]
STEPS = 40
PEERS = ("f", "g", "main", "recorder")
MESH = """
[mesh]
name = "late"
dt = 0.02
[model]
A = [[1.0]]
B = [[1.0]]
rho = [0.001]
[model.prior]
lower = [-1.0]
upper = [1.0]
[model.domain]
lower = [-9.0]
upper = [9.0]
[model.input_box]
lower = [-0.5]
upper = [0.5]
[plant]
[sensors.s1]
C = [[1.0]]
r = [0.1]
[filters.f]
kind = "LSUO"
sensors = ["s1"]
deadline = "40ms"
[filters.g]
kind = "LSUCZ"
sensors = ["s1"]
deadline = "40ms"
[fusion.main]
sources = ["f", "g"]
[recorder]
predictions = true
"""


@pytest.mark.live
def test_a_recording_of_late_inputs_verifies(
    start: Start, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mesh.toml").write_text(MESH)
    recorder = start("recorder", "-c", "mesh.toml", "--record", "late.rrd", "-l", "{endpoint}")
    at = recorder.endpoint
    estimators = [
        start(*words, "-c", "mesh.toml", "-e", at, endpoint=at)
        for words in (("filter", "f"), ("filter", "g"), ("fusion", "main"))
    ]
    command = [sys.executable, str(root / "tests" / "late_plant.py"), at, "late", str(STEPS), *PEERS]
    with subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as plant:
        assert plant.stdout is not None
        boxed = json.loads(plant.stdout.readline())
        for session in (*estimators, recorder):
            session.process.send_signal(signal.SIGINT)
            assert session.wait() == 0, session.output[1]
        plant.communicate("enough\n", timeout=30)
    assert boxed == list(range(3, STEPS + 2, 2))
    recording = read_recording(tmp_path / "late.rrd")
    assert recording.damaged == []
    assert made_twice(recording) >= set(boxed) - {STEPS + 1}  # the last one is told to end before it can do so
    assert any(isinstance(one.message, Fused) for one in recording.received)
    sets = [one for one in recording.received if isinstance(one.message, Posterior | Prediction)]
    capsys.readouterr()
    code = main(["replay", str(tmp_path / "late.rrd"), "--verify", "--json"])
    output = capsys.readouterr().out.splitlines()
    summary = json.loads(output[-1])
    assert (code, summary["different"], summary["unverifiable"]) == (0, 0, 0), output
    assert summary["exact"] >= len(sets) - 1 > 4 * STEPS


def made_twice(recording: Recording) -> set[int]:
    """Steps that ``f`` predicted with the input box, and again with the input."""
    predictions = [one.message for one in recording.received if isinstance(one.message, Prediction)]
    ways = Counter((one.step, tuple(one.missing)) for one in predictions if one.name == "f")
    return {step for step, missing in ways if missing == ("input",) and (step, ()) in ways}
