"""A long recording is written in parts, each of which opens alone; together they are the recording in one file."""

from __future__ import annotations

from pathlib import Path

import pytest
from drawn import drawn
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.read import read_description, read_raw, read_recording
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.stream import recording_id
from lsu_mesh_services.recording.summary import summary
from lsu_mesh_services.recording.synthetic_mesh import Arrival, SyntheticMesh, written
from rerun.chunk import RrdReader

from lsu_mesh.mesh.config import load

STEPS = 300


def recorded(folder: Path, *overrides: str) -> tuple[Path, list[Arrival]]:
    """Six seconds of a mesh at 50 Hz."""
    configuration = load(written(folder, 2, 2).path, list(overrides))
    recorder, arrivals = Recorder(configuration, folder / "run.rrd"), SyntheticMesh(configuration).run(STEPS)
    for arrival in arrivals:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    assert recorder.problems == []
    assert recorder.flushed == {arrival.key: arrival.message.seq for arrival in arrivals}
    return folder / "run.rrd", arrivals


@pytest.mark.parametrize("limit", ["recorder.part_time=2s", "recorder.part_size=450kB"])
def test_parts_are_read_as_one(tmp_path: Path, limit: str) -> None:
    path, arrivals = recorded(tmp_path, limit)
    files = parts(path)
    assert [file.name for file in files] == ["run.rrd", *(f"run.part{i}.rrd" for i in range(2, len(files) + 1))]
    assert 2 <= len(files) <= 4
    assert [raw.payload for raw in read_raw(*files)] == [arrival.payload for arrival in arrivals]
    assert len(read_recording(path).received) == len(arrivals)
    found = summary(path)
    assert (found.steps, found.lost, len(found.files)) == (STEPS, 0, len(files))
    assert {recording_id(file) for file in files} == {recording_id(path)}
    steps = [step for file in files for step, _ in drawn(file, "/bands/alpha/f1", "Measurements:values")]
    assert steps == list(range(1, STEPS + 1, 5))


def test_each_part_opens_alone(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, "recorder.part_time=2s")
    whole = read_description(path)
    for file in parts(path):
        assert read_description(file) == whole != {}
        assert RrdReader(file).blueprints()
        styled = [
            chunk for chunk in RrdReader(file).stream().filter(content="/bands/alpha/f1")
            if "Measurements:colors" in chunk.to_record_batch().schema.names
        ]  # fmt: skip
        assert styled, file


def test_a_lost_part_is_a_loss_between_the_others(tmp_path: Path) -> None:
    path, arrivals = recorded(tmp_path, "recorder.part_time=2s")
    lost = len(read_raw(parts(path)[1]))
    parts(path)[1].unlink()
    found = summary(path)
    assert found.lost == lost > 0
    assert sum(peer.messages for peer in found.peers) == len(arrivals) - lost
    assert len(found.losses) == 1
    assert 95 <= found.losses[0].first_step <= 105
    assert 195 <= found.losses[0].last_step <= 205


def test_without_limits_there_is_one_file(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, "recorder.part_time=0s", "recorder.part_size=0MB")
    assert parts(path) == (path,)


def test_merge_makes_one_file_of_parts(tmp_path: Path) -> None:
    path, arrivals = recorded(tmp_path, "recorder.part_time=2s")
    assert main(["recording", "merge", str(path)]) == OK
    assert [raw.payload for raw in read_raw(tmp_path / "run.merged.rrd")] == [arrival.payload for arrival in arrivals]
