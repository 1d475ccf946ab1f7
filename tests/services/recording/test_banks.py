"""A recording of banks: the messages whole, and drawings of a few targets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
from bank_mesh import posteriors, targets, truths
from local_mesh import LocalMesh
from lsu_mesh_services.recording.read import read_recording
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import START_NS
from recorded_mesh import record
from rerun.chunk import RrdReader

from lsu_mesh.mesh.messages import encode


def values(file: Path, entity: str) -> np.ndarray:
    """The numbers of an entity, a row per step."""
    found: dict[int, list[float]] = {}
    for chunk in RrdReader(file).stream().filter(content=entity):
        batch = pa.record_batch(chunk.to_record_batch())
        names = [name for name in batch.schema.names if name.endswith(("scalars", "values"))]
        if names and "step" in batch.schema.names:
            found |= dict(zip(batch["step"].to_pylist(), batch[names[0]].to_pylist(), strict=True))
    return np.array([found[step] for step in sorted(found)])


def test_payloads_are_whole_and_a_few_targets_are_drawn(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path, "sensors.radar.faults=[{kind='bias',from=30,size=90.0,instances=[2]}]"))
    mesh.run(5.0)
    file = record(mesh, tmp_path / "banks.rrd")
    recording = read_recording(file)
    assert recording.damaged == []
    assert [one.payload for one in recording.received] == [encode(message) for _, message in mesh.sent]
    found, x = posteriors(mesh.sent), truths(mesh.sent)
    widths = values(file, "/bank_widths/targets")
    believed = found[40].status_codes != 2
    last = (found[40].matrix("upper") - found[40].matrix("lower")).mean(axis=1)[believed]
    assert widths.shape == (40, 3)
    assert widths[-1].tolist() == np.quantile(last, [0.5, 0.95, 1.0]).tolist()
    assert values(file, "/bank_counts/targets")[-1].tolist() == [1.0, 0.0]
    assert values(file, "/targets/2/x3/truth")[-1].tolist() == [x[40].matrix("x")[2, 2]]
    band = values(file, "/targets/2/x3/bands/targets")[-1]
    assert band[1] == found[40].matrix("lower")[2, 2]
    assert values(file, "/targets/3/**").size == 0, "a few targets only"


def test_drawings_are_thinned(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path, "recorder.mesh_hz=5"))
    mesh.run(5.0)
    recorder = Recorder(mesh.configuration, tmp_path / "thin.rrd")
    for address, message in mesh.sent:
        recorder.record(address, encode(message), START_NS + message.sent_ns, message)
    recorder.close()
    assert recorder.problems == []
    assert len(values(tmp_path / "thin.rrd", "/bank_widths/targets")) == 20
    assert len(read_recording(tmp_path / "thin.rrd").received) == len(mesh.sent)
