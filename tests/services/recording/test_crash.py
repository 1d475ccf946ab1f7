"""A recorder that is killed leaves a file that opens and that lacks at most what came after the last flush."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from headless_viewer import HeadlessViewer, why_not
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.repair import repair
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh, written

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.config.settings import RecorderSettings

WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh
from lsu_mesh.mesh.config import load
from lsu_mesh_services.recording.recorder import Recorder
recorder = Recorder(load(Path(sys.argv[2])), Path(sys.argv[3]))
mesh, told = SyntheticMesh(load(Path(sys.argv[2]))), 0
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
    gap = RecorderSettings.flush + 0.3  # the flush interval, and a busy machine
    span = (truths[-1].arrival_ns - truths[0].arrival_ns) / len(truths) / 1e9
    assert (recorded - flushed) * span <= gap


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.3, 1.0, exclude_max=True))
def test_a_file_cut_anywhere_gives_what_was_whole(
    share: float, tmp_path_factory: pytest.TempPathFactory, whole_recording: Path
) -> None:
    everything = read_raw(whole_recording)
    data = whole_recording.read_bytes()
    folder = tmp_path_factory.mktemp("cut")
    cut = folder / "cut.rrd"
    cut.write_bytes(data[: int(share * len(data))])
    found = read_raw(cut)
    assert set(found) <= set(everything)
    assert len(found) >= 0.5 * share * len(everything) - 100
    repair([cut], cut)
    assert read_raw(cut) == found
    assert [entry.name for entry in folder.iterdir()] == ["cut.rrd"]


def test_parts_are_joined(tmp_path: Path) -> None:
    configuration = written(tmp_path, 2, 2)
    mesh, parts = SyntheticMesh(configuration), []
    for number in (1, 2):
        parts.append(next_part(tmp_path / "run.rrd"))
        recorder = Recorder(configuration, parts[-1], continues=parts[0] if number > 1 else None)
        for arrival in mesh.run(20):
            recorder.record(*arrival)
        recorder.close()
    repair(parts, tmp_path / "joined.rrd")
    assert [part.name for part in parts] == ["run.rrd", "run.part2.rrd"]
    assert len(read_raw(parts[1])) > 100
    assert read_raw(tmp_path / "joined.rrd") == read_raw(parts[0]) + read_raw(parts[1])


@pytest.fixture(scope="module")
def whole_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    configuration = load(written(folder, 2, 2).path, ["recorder.flush=200ms"])
    recorder = Recorder(configuration, folder / "whole.rrd")
    for arrival in SyntheticMesh(configuration).run(200):
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    return recorder.path


@pytest.mark.viewer
@pytest.mark.skipif(why_not() is not None, reason=why_not() or "")
def test_the_file_of_a_killed_recorder_opens(tmp_path: Path) -> None:
    path, _, _ = killed_recording(tmp_path, 8)
    with HeadlessViewer() as viewer:
        viewer.open(path)
        viewer.picture(tmp_path / "killed.png", settled=False)
        assert viewer.complaints() == []
        assert viewer.last_step() > 20
