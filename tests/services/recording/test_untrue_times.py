"""Data whose time cannot be true are kept, and do not stretch the axis of a recording."""

from __future__ import annotations

from pathlib import Path

from drawn import drawn
from external_mesh import MESH
from lsu_mesh_services.recording.read import read_recording
from lsu_mesh_services.recording.recorder import Recorder

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import Measurement, encode

SECOND = 10**9
START_NS = 1_700_000_000 * SECOND
OFFSETS_S = (0, 3600, -3600, 0)


def test_a_clock_that_is_an_hour_wrong_leaves_the_axis_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(MESH)
    configuration = load(file).started(START_NS)
    recorder = Recorder(configuration, tmp_path / "own.rrd")
    for i, offset_s in enumerate(OFFSETS_S):
        arrival_ns = START_NS + (i + 1) * SECOND
        stamp = arrival_ns + offset_s * SECOND
        message = Measurement(
            v=1, src="sensor/gauge", boot="0123456789abcdef", seq=i, step=0, sent_ns=stamp, origin_ns=stamp,
            model=configuration.digest(), y=[1.0], time_ns=stamp, time_error_ns=0,
        )  # fmt: skip
        address = key("own", "measurement", "gauge")
        recorder.record(address, encode(message), arrival_ns, placed(configuration, message))
    recorder.close()
    assert recorder.problems == []
    assert len(read_recording(recorder.path).received) == len(OFFSETS_S), "nothing is lost"
    kept = [step for step, _ in drawn(recorder.path, "/raw/measurement/gauge", "lsu.Raw:payload")]
    assert kept == [10, 10, 10, 40], "those of the wrong clock at the step where the mesh is"
    shown = drawn(recorder.path, "/measured/gauge/gauge", "Scalars:scalars")
    assert [step for step, _ in shown] == [10, 40]
