"""A recorder that is killed leaves a file that opens and that lacks at most what came after the last flush."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from headless_viewer import HeadlessViewer, why_not
from made_up_mesh import written

from services.recording.read import read_raw

WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from made_up_mesh import MadeUpMesh
from lsu_mesh.mesh.config import load
from services.recording.recorder import Recorder
recorder = Recorder(load(Path(sys.argv[2])), Path(sys.argv[3]))
mesh, told = MadeUpMesh(load(Path(sys.argv[2]))), 0
for k in range(1, 100000):
    for arrival in mesh.step(k):
        recorder.record(arrival.key, arrival.payload, time.time_ns(), arrival.message)
    print("recorded", k, flush=True)
    recorder.tick(time.time_ns())
    flushed = recorder.flushed.get("lsu/v1/made-up/truth/plant", -1) + 1
    if flushed > told:
        told = flushed
        print("flushed", flushed, flush=True)
    time.sleep(0.01)
"""


def killed_recording(folder: Path, flushes: int) -> tuple[Path, int, int]:
    """The file of a recorder killed after so many flushes; the last step said to be flushed, the last one recorded."""
    configuration = written(folder, 2, 2)
    path = folder / "killed.rrd"
    tests = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", WRITER, str(tests), str(configuration.path), str(path)]
    flushed = recorded = seen = 0
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tests.parent) as process:
        assert process.stdout is not None
        for line in process.stdout:
            what, number = line.split()
            if what == "recorded":
                recorded = int(number)
            else:
                flushed, seen = int(number), seen + 1
            if seen == flushes and recorded >= flushed + 3:
                os.kill(process.pid, signal.SIGKILL)
                break
        for line in process.stdout:  # what was said before the signal arrived
            what, number = line.split()
            flushed, recorded = (int(number), recorded) if what == "flushed" else (flushed, int(number))
    assert process.returncode == -signal.SIGKILL
    return path, flushed, recorded


@pytest.mark.parametrize("flushes", [2, 5])
def test_nothing_that_was_flushed_is_lost(flushes: int, tmp_path: Path) -> None:
    path, flushed, recorded = killed_recording(tmp_path, flushes)
    messages = read_raw(path)
    truths = [message for message in messages if "/truth/" in message.key]
    assert flushed <= len(truths) <= recorded
    assert flushed < recorded, "the recorder was killed between flushes"
    arrivals = [message.arrival_ns for message in messages]
    assert arrivals == sorted(arrivals)
    gap = 0.2 + 0.3  # the flush interval, and a busy machine
    span = (truths[-1].arrival_ns - truths[0].arrival_ns) / len(truths) / 1e9
    assert (recorded - flushed) * span <= gap


@pytest.mark.viewer
@pytest.mark.skipif(why_not() is not None, reason=why_not() or "")
def test_the_file_of_a_killed_recorder_opens(tmp_path: Path) -> None:
    path, _, _ = killed_recording(tmp_path, 8)
    with HeadlessViewer() as viewer:
        viewer.open(path)
        viewer.picture(tmp_path / "killed.png")
        assert viewer.complaints() == []
        assert viewer.last_step() > 20
