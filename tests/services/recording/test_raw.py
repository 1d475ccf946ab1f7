"""Raw payloads come back bit by bit, in the order in which they came."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lsu_mesh_services.recording.read import RawMessage, read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import START_NS, Arrival, SyntheticMesh, written

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import decode

Record = Callable[[Configuration, Sequence[Arrival]], Path]


def test_every_payload_comes_back_in_order(configuration: Configuration, record: Record) -> None:
    arrivals = SyntheticMesh(configuration).run(40)
    arrivals[7], arrivals[90] = arrivals[90], arrivals[7]  # late and early messages
    read = read_raw(record(configuration, arrivals))
    assert read == [RawMessage(a.key, a.arrival_ns, a.payload) for a in arrivals]
    assert decode("posterior", next(m.payload for m in read if "/posterior/" in m.key)).step == 1


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    refused=st.lists(st.tuples(st.text(max_size=40), st.binary(max_size=300), st.integers(0, 2**63 - 1)), max_size=8)
)
def test_refused_payloads_are_kept_apart(
    refused: list[tuple[str, bytes, int]], configuration: Configuration, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("refused") / "x.rrd"
    recorder = Recorder(configuration, path)
    good = SyntheticMesh(configuration).step(1)
    for one in refused:
        recorder.record(*one, None)
    for arrival in good:
        recorder.record(*arrival)
    recorder.close()
    assert recorder.problems == []
    everything = read_raw(path, refused=True)
    assert [(m.key, m.payload, m.arrival_ns) for m in everything[: len(refused)]] == refused
    assert read_raw(path) == everything[len(refused) :]
    assert len(everything) == len(refused) + len(good)


def test_a_file_that_is_no_recording(tmp_path: Path) -> None:
    other = tmp_path / "other.rrd"
    other.write_text("no recording")
    with pytest.raises(ValueError, match=r"other\.rrd: not a Rerun recording"):
        read_raw(other)
    with pytest.raises(FileNotFoundError):
        read_raw(tmp_path / "missing.rrd")


def test_one_flush_holds_what_came_before_it(tmp_path: Path) -> None:
    configuration = written(tmp_path)
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    arrivals = SyntheticMesh(configuration).run(30)
    half = len(arrivals) // 2
    for arrival in arrivals[:half]:
        recorder.record(*arrival)
    recorder.tick(START_NS + 10**10)
    newest = {arrival.key: arrival.message.seq for arrival in arrivals[:half]}
    assert recorder.flushed == newest
    for arrival in arrivals[half:]:
        recorder.record(*arrival)
    recorder.tick(START_NS + 10**10 + 1)  # the interval is not over
    assert recorder.flushed == newest
    stored = read_raw(tmp_path / "x.rrd")  # the file is readable while it is written
    assert [m.payload for m in stored] == [a.payload for a in arrivals[:half]]
    recorder.close()
    assert recorder.flushed == {arrival.key: arrival.message.seq for arrival in arrivals}
    assert len(read_raw(tmp_path / "x.rrd")) == len(arrivals)
