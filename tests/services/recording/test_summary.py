"""The summary of a recording, read chunk by chunk, counts what reading all of it counts."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from pathlib import Path

import msgpack
import pytest
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.read import read_recording
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.summary import Summary, summary
from lsu_mesh_services.recording.synthetic_mesh import START_NS, Arrival, SyntheticMesh, written

from lsu_mesh.mesh.messages import Event, read


def recorded(folder: Path, arrivals: list[Arrival], refused: int = 0) -> Path:
    """A part of a recording of the made-up mesh; later ones of a restarted recorder."""
    part = next_part(folder / "run.rrd")
    first = folder / "run.rrd"
    recorder = Recorder(written(folder), part, continues=first if part != first else None)
    for i in range(refused):
        recorder.record("lsu/v1/made-up/truth/plant", b"?", START_NS + i, None)
    for arrival in arrivals:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    assert recorder.problems == []
    return first


def check(found: Summary, path: Path) -> None:
    """Against all messages at once."""
    whole = read_recording(path)
    counts = Counter("/".join(one.key.split("/")[3:]) for one in whole.received)
    assert {peer.key: peer.messages for peer in found.peers} == counts
    assert found.steps == max(one.message.step for one in whole.received)
    arrivals = [one.arrival_ns for one in whole.received]
    assert found.seconds == (max(arrivals) - min(arrivals)) / 1e9
    assert found.damaged == len(whole.damaged)
    assert found.unknown_fields == whole.unknown_fields
    assert found.statuses == Counter(one.message.status for one in whole.received if hasattr(one.message, "status"))


def test_everything_is_counted(tmp_path: Path) -> None:
    mesh = SyntheticMesh(written(tmp_path))
    arrivals = mesh.run(200)
    event = Event(**mesh.stamp("event", "filter/f2", 4), level="ERROR", code="late", text="too late", about={})
    arrivals.insert(300, mesh.arrival(event, 40))
    path = recorded(tmp_path, arrivals, refused=3)
    found = summary(path)
    check(found, path)
    assert (found.refused, found.lost, found.losses, bool(found.damage)) == (3, 0, [], False)
    assert found.events == {"ERROR late": 1}
    assert all(peer.gaps == 0 and peer.boots == 1 and peer.messages in (1, 200) for peer in found.peers)
    assert found.about["mesh"] == "made-up"


def test_gaps_and_late_messages(tmp_path: Path) -> None:
    arrivals = SyntheticMesh(written(tmp_path)).run(120)
    never = [a for a in arrivals if a.message.name == "f1" and 50 <= a.message.step < 60]
    late = next(a for a in arrivals if a.message.name == "f2" and a.message.step == 20)
    kept = [a for a in arrivals if a not in never and a is not late]
    found = summary(recorded(tmp_path, [*kept, late]))
    check(found, tmp_path / "run.rrd")
    gaps = {peer.key: peer.gaps for peer in found.peers}
    assert (gaps["posterior/f1"], gaps["prediction/f1"], gaps["posterior/f2"], gaps["prediction/f2"]) == (10, 10, 0, 0)
    assert found.lost == 0, "what never came is not lost"


def test_parts_are_one_and_copies_count_once(tmp_path: Path) -> None:
    arrivals = SyntheticMesh(written(tmp_path)).run(60)
    recorded(tmp_path, arrivals[:400])
    found = summary(recorded(tmp_path, arrivals[300:]))
    check(found, tmp_path / "run.rrd")
    assert sum(peer.messages for peer in found.peers) == len(arrivals)
    assert [Path(file).name for file in found.files] == ["run.rrd", "run.part2.rrd"]
    assert found.lost == 0, "a recorder that was started again counts on from its clock"


def test_fields_of_a_newer_version_are_counted(tmp_path: Path) -> None:
    arrivals = SyntheticMesh(written(tmp_path)).run(30)
    for i, arrival in enumerate(arrivals):
        if arrival.message.topic == "truth" and arrival.message.step > 10:
            payload = msgpack.packb({**msgpack.unpackb(arrival.payload), "colour": 1})
            arrivals[i] = arrival._replace(payload=payload, message=read("truth", payload)[0])
    found = summary(recorded(tmp_path, arrivals))
    check(found, tmp_path / "run.rrd")
    assert found.unknown_fields == {"truth.colour": 20}


def test_memory_does_not_grow_with_the_run(tmp_path: Path) -> None:
    path = recorded(tmp_path, SyntheticMesh(written(tmp_path)).run(1500))
    payloads = 1500 * 4900
    summary(path)  # what is loaded once
    tracemalloc.start()
    summary(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 0.5 * payloads


def test_a_file_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "text.rrd").write_text("no recording")
    with pytest.raises(ValueError, match="not a Rerun recording"):
        summary(tmp_path / "text.rrd")
    with pytest.raises(FileNotFoundError):
        summary(tmp_path / "missing.rrd")
