"""What is drawn is what was said, and nothing that comes can stop the recorder."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.repair import repair
from lsu_mesh_services.recording.set_geometry import SetGeometry, body
from lsu_mesh_services.recording.stream import next_part
from lsu_mesh_services.recording.synthetic_mesh import START_NS, STEP_NS, Arrival, SyntheticMesh, written
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Event, Fused, Health, Measurement, Posterior, Prediction, Rejection, Truth
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Record = Callable[[Configuration, Sequence[Arrival]], Path]


def drawn(path: Path, entity: str, component: str) -> list[tuple[int, list[Any]]]:
    """``(step, values)`` of one component of one entity, in the order of steps."""
    rows: list[tuple[int, list[Any]]] = []
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        chunks = RrdReader(path).stream().filter(content=entity)
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if component in batch.schema.names and "step" in batch.schema.names:
            rows += zip(batch.column("step").to_pylist(), batch.column(component).to_pylist(), strict=True)
    return sorted(((step, values) for step, values in rows if values is not None), key=lambda row: row[0])


def values_of(path: Path, entity: str, component: str = "Measurements:values") -> NDArray[np.float64]:
    """Values as (rows, series)."""
    return np.array([values for _, values in drawn(path, entity, component)])


def messages(arrivals: Sequence[Arrival], kind: type, name: str = "") -> list[Any]:
    return [a.message for a in arrivals if type(a.message) is kind and name in ("", a.message.name)]


def has_index(path: Path) -> bool:
    """Whether the file ends with an index of its chunks: Rerun warns where it has to make one."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        RrdReader(path).stream().to_chunks()
    return not any("no footer" in str(warning.message) for warning in caught)


@pytest.fixture
def arrivals(configuration: Configuration) -> list[Arrival]:
    return SyntheticMesh(configuration).run(60)


@pytest.mark.parametrize(("override", "is_short"), [("mesh.steps=15000", True), ("mesh.steps=15001", False)])
def test_only_short_runs_have_an_index_which_grows_in_memory_till_their_end(
    configuration: Configuration, arrivals: list[Arrival], record: Record, override: str, is_short: bool
) -> None:
    path = record(load(configuration.path, [override]), arrivals)
    assert has_index(path) is is_short
    assert [message.payload for message in read_raw(path)] == [arrival.payload for arrival in arrivals]
    repair([path], path)
    assert has_index(path)
    assert [message.payload for message in read_raw(path)] == [arrival.payload for arrival in arrivals]


def test_truth_bands_and_errors_are_the_numbers_of_the_messages(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    truth = np.array([m.x for m in messages(arrivals, Truth)])
    for name, kind in (("f1", Posterior), ("f2", Posterior), ("f3", Posterior), ("main", Fused)):
        said = messages(arrivals, kind, name)
        for i, state in enumerate(("alpha", "beta", "gamma")):
            assert (values_of(path, f"/truth/{state}")[:, 0] == truth[:, i]).all()
            lower, point, upper = (np.array([getattr(m, f)[i] for m in said]) for f in ("lower", "point", "upper"))
            band = values_of(path, f"/bands/{state}/{name}")
            assert (band[:, 1:] == np.stack([lower, point, upper], axis=1)).all()
            half = np.sqrt(values_of(path, f"/bands/{state}/{name}", "Measurements:variances")[:, 0])
            assert band[:, 0] - half == pytest.approx(lower)
            assert band[:, 0] + half == pytest.approx(upper)
            errors = values_of(path, f"/errors/{state}/{name}")
            assert (errors[:, 1:4] == band[:, 1:] - truth[:, [i]]).all()
            assert (errors[:, 1] <= 0).all()
            assert (errors[:, 3] >= 0).all()
        widths = values_of(path, f"/widths/{name}", "Scalars:scalars")
        assert (widths == np.array([np.subtract(m.upper, m.lower) for m in said])).all()
        volumes = drawn(path, f"/log_volume/{name}", "Scalars:scalars")
        assert volumes == [(m.step, [m.log_volume]) for m in said if m.log_volume is not None]


def test_errors_wait_for_a_truth_that_comes_late(configuration: Configuration, record: Record) -> None:
    mesh = SyntheticMesh(configuration)
    arrivals = mesh.run(30)
    late = [a for a in arrivals if not isinstance(a.message, Truth)] + [
        a for a in arrivals if isinstance(a.message, Truth)
    ]
    path = record(configuration, late)
    assert [step for step, _ in drawn(path, "/errors/alpha/f1", "Measurements:values")] == list(range(1, 31))


def test_outputs_and_their_predictions(configuration: Configuration, arrivals: list[Arrival], record: Record) -> None:
    path = record(configuration, arrivals)
    said = messages(arrivals, Prediction, "f2")
    for i, sensor in enumerate(("s1", "s2", "s3")):
        band = values_of(path, f"/outputs/{sensor}/{sensor}/f2")
        assert (band[:, 1] == [m.y_lower[i] for m in said]).all()
        assert (band[:, 3] == [m.y_upper[i] for m in said]).all()
        measured = drawn(path, f"/measured/{sensor}/{sensor}", "Scalars:scalars")
        expected = [(m.step, m.y) for m in messages(arrivals, Measurement, sensor) if m.y != [None]]
        assert measured == expected
        assert len(expected) == 59  # one is missing


def test_latency_is_the_age_of_the_oldest_measurement(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    said = [a for a in arrivals if type(a.message) is Posterior and a.message.name == "f1"]
    expected = [(a.arrival_ns - a.message.origin_ns) / 1e6 for a in said]
    assert values_of(path, "/latency/f1", "Scalars:scalars")[:, 0] == pytest.approx(expected)
    assert expected[0] == pytest.approx(3.0, abs=0.1)


def test_sets_are_thinned_to_common_steps_and_numbers_are_not(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    steps = {
        name: [step for step, _ in drawn(path, f"/space/sets/{name}", "Mesh3D:vertex_positions")]
        for name in ("f1", "f2", "f3", "main")
    }
    assert len(steps["f1"]) in range(11, 14)  # 1.2 s at 10 Hz
    assert steps["f1"] == steps["f2"] == steps["f3"] == steps["main"]
    assert [step for step, _ in drawn(path, "/space/truth", "Points3D:positions")] == steps["f1"]
    truth = {m.step: m.x for m in messages(arrivals, Truth)}
    for step, points in drawn(path, "/space/truth", "Points3D:positions"):
        assert points == [pytest.approx(truth[step], rel=1e-6)]
    boxes = {m.step: m for m in messages(arrivals, Posterior, "f1")}
    for step, corners in drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions"):
        assert np.min(corners, axis=0) == pytest.approx(boxes[step].lower, rel=1e-5, abs=1e-6)
        assert np.max(corners, axis=0) == pytest.approx(boxes[step].upper, rel=1e-5, abs=1e-6)


def test_a_peer_that_fell_silent_shows_no_old_set(configuration: Configuration, record: Record) -> None:
    arrivals = [a for a in SyntheticMesh(configuration).run(200) if a.message.name != "f2" or a.message.step < 60]
    path = record(configuration, arrivals)
    shown = drawn(path, "/space/sets/f2", "Mesh3D:vertex_positions")
    assert [bool(corners) for step, corners in shown if step < 60] == [True] * (len(shown) - 1)
    assert shown[-1][0] >= 60
    assert shown[-1][1] == []
    assert max(step for step, _ in drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions")) > 100


def test_status_lanes_change_only_when_the_status_does(configuration: Configuration, record: Record) -> None:
    mesh = SyntheticMesh(configuration)
    box = Orthotope([-1, -1, -1], [1, 1, 1])
    course = ["ok", "ok", "inconsistent", "inconsistent", "predicted", "ok"]
    arrivals = [mesh.arrival(mesh.posterior("filter/f1", k + 1, box, status=s), k + 1) for k, s in enumerate(course)]
    fused = [
        mesh.posterior("fusion/main", 1, box, used=["f1", "f2", "f3"]),
        mesh.posterior("fusion/main", 2, box, used=["f1"], rejected=[Rejection(source="f2", reason="disjoint")]),
        mesh.posterior("fusion/main", 3, box, used=["f1"], quarantined=["f2"]),
    ]
    arrivals += [mesh.arrival(m, m.step, 9) for m in fused]
    levels = [("OK", 1), ("WARN", 2), ("WARN", 3)]
    arrivals += [
        mesh.arrival(
            Health(**mesh.stamp("health", "filter/f1", 0), role="filter", level=level, reasons=[], counters={}), k
        )  # type: ignore[arg-type]
        for level, k in levels
    ]
    path = record(configuration, arrivals)
    lane = drawn(path, "/status/f1", "StateChange:state")
    assert lane == [(1, ["ok"]), (3, ["inconsistent"]), (5, ["predicted"]), (6, ["ok"])]
    assert drawn(path, "/trust/main/f1", "StateChange:state") == [(1, ["accepted"])]
    assert drawn(path, "/trust/main/f2", "StateChange:state") == [
        (1, ["accepted"]),
        (2, ["rejected"]),
        (3, ["quarantined"]),
    ]
    assert drawn(path, "/trust/main/f3", "StateChange:state") == [(1, ["accepted"]), (2, ["silent"])]
    assert [state for _, state in drawn(path, "/health/f1", "StateChange:state")] == [["OK"], ["WARN"]]


def test_what_is_said_again_of_an_older_step_does_not_change_the_lane_of_the_newest(
    configuration: Configuration, record: Record
) -> None:
    mesh = SyntheticMesh(configuration)
    box = Orthotope([-1, -1, -1], [1, 1, 1])
    sources, rejected = ["f1", "f2", "f3"], [Rejection(source="f2", reason="disjoint")]
    fused = [
        mesh.posterior("fusion/main", 1, box, used=sources),
        mesh.posterior("fusion/main", 2, box, used=["f1", "f3"], rejected=rejected),
        mesh.posterior("fusion/main", 3, box, used=sources),
        mesh.posterior("fusion/main", 2, box, used=["f1", "f3"], rejected=rejected, revision=1),
        mesh.posterior("fusion/main", 4, box, used=["f1", "f3"], rejected=rejected),
    ]
    path = record(configuration, [mesh.arrival(m, i + 1, 9) for i, m in enumerate(fused)])
    lane = drawn(path, "/trust/main/f2", "StateChange:state")
    assert lane == [(1, ["accepted"]), (2, ["rejected"]), (3, ["accepted"]), (4, ["rejected"])]


def test_peers_that_go_are_seen_in_lanes_graph_and_events(configuration: Configuration, tmp_path: Path) -> None:
    path = tmp_path / "x.rrd"
    recorder = Recorder(configuration, path)
    mesh = SyntheticMesh(configuration)
    recorder.peer_changed("filter", "f1", True, START_NS)
    for arrival in mesh.run(5):
        recorder.record(*arrival)
    recorder.peer_changed("filter", "f1", False, START_NS + 6 * STEP_NS)
    for arrival in mesh.run(30):
        if arrival.message.name != "f1":
            recorder.record(*arrival)
    recorder.peer_changed("peer", "stranger/über", True, START_NS + 6 * STEP_NS)
    event = Event(
        **mesh.stamp("event", "filter/f2", 4),
        level="ERROR",
        code="late",
        text="step 4: too late",
        about={"sensor": "s1"},
    )
    recorder.record(*mesh.arrival(event, 5))
    recorder.close()
    assert recorder.problems == []
    assert [s for _, s in drawn(path, "/health/f1", "StateChange:state")] == [["OK"], ["gone"]]
    assert [s for _, s in drawn(path, "/status/f1", "StateChange:state")] == [["ok"], ["gone"]]
    assert drawn(path, "/events/f1", "TextLog:text")[-1] == (5, ["step 5, f1: filter is gone"])
    assert drawn(path, "/events/f2", "TextLog:text") == [(4, ["step 4, f2: late: too late"])]
    assert drawn(path, "/events/f2", "TextLog:level") == [(4, ["ERROR"])]
    nodes = drawn(path, "/topology", "GraphNodes:node_ids")[-1][1]
    assert {"f1", "s1", "plant", "main", "recorder", "stranger/über"} <= set(nodes)


def test_the_end_of_a_run_is_no_series_of_failures(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    for name in ("f1", "f2"):
        recorder.peer_changed("filter", name, True, START_NS)
    for arrival in SyntheticMesh(configuration).run(5):
        recorder.record(*arrival)
    for name in ("f1", "f2"):
        recorder.peer_changed("filter", name, False, START_NS + 6 * STEP_NS)
    recorder.close()
    assert [s for _, s in drawn(recorder.path, "/status/f1", "StateChange:state")] == [["ok"]]
    assert drawn(recorder.path, "/events/recorder", "TextLog:text") == [
        (5, ["step 5, recorder: the run ended: f1, f2"])
    ]
    assert drawn(recorder.path, "/events/f1", "TextLog:level") == [(0, ["INFO"])]


def test_a_departure_is_drawn_when_nothing_follows_for_long(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    recorder.peer_changed("filter", "f1", True, START_NS)
    recorder.peer_changed("filter", "f1", False, START_NS + 10**9)
    recorder.tick(START_NS + 5 * 10**9)
    recorder.close()
    assert [s for _, s in drawn(recorder.path, "/health/f1", "StateChange:state")] == [["OK"], ["gone"]]


def test_what_cannot_be_drawn_is_counted_and_stored_all_the_same(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    mesh = SyntheticMesh(configuration)
    arrivals = mesh.run(3)
    flat = Orthotope([0.0], [1.0])  # one coordinate in a mesh of three
    wrong = [
        mesh.arrival(mesh.posterior("filter/f1", 4, flat), 4),
        mesh.arrival(mesh.posterior("filter/f1", 5, flat), 5),
    ]
    stamp = mesh.stamp("measurement", "sensor/s1", 4)
    wrong.append(mesh.arrival(Measurement(**stamp, y=[1.0, 2.0], time_ns=0), 4))
    for arrival in arrivals + wrong:
        recorder.record(*arrival)
    recorder.close()
    assert recorder.problems
    assert all("Error" in problem for problem in recorder.problems)
    assert [m.payload for m in read_raw(recorder.path)] == [a.payload for a in arrivals + wrong]
    assert len(drawn(recorder.path, "/truth/alpha", "Measurements:values")) == 3
    assert len(drawn(recorder.path, "/bands/alpha/f2", "Measurements:values")) == 3


def test_problems_are_counted_by_kind(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    mesh = SyntheticMesh(configuration)
    for k in range(3):
        stamp = mesh.stamp("measurement", "sensor/s1", k)
        recorder.record(*mesh.arrival(Measurement(**stamp, y=[1.0, 2.0], time_ns=0), k))
    recorder.close()
    (problem,) = recorder.problems
    assert problem.startswith("drawing measurement of sensor/s1: ValueError")
    assert problem.endswith("(3 times)")


def test_a_set_that_cannot_be_drawn_leaves_the_others_be(
    configuration: Configuration, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unlucky(support: Support) -> SetGeometry:
        if isinstance(support, ConstrainedZonotope):
            raise ArithmeticError("no vertices today")
        return body(support)

    recorder = Recorder(configuration, tmp_path / "x.rrd")
    monkeypatch.setattr("lsu_mesh_services.recording.sets_3d.body", unlucky)
    for arrival in SyntheticMesh(configuration).run(3):
        recorder.record(*arrival)
    recorder.close()
    assert recorder.problems == ["drawing space: ArithmeticError: no vertices today"]
    assert drawn(recorder.path, "/space/sets/f1", "Mesh3D:vertex_positions")[0][1]
    assert drawn(recorder.path, "/space/sets/f3", "Mesh3D:vertex_positions") == [(1, [])]
    assert values_of(recorder.path, "/bands/alpha/f3").shape == (3, 4)


def test_a_file_that_exists_is_never_overwritten(configuration: Configuration, tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError) as raised:
        Recorder(configuration, path)
    assert raised.value.errno == errno.EEXIST
    assert raised.value.filename == str(path)
    assert path.read_bytes() == b"precious"
    assert next_part(path) == tmp_path / "run.part2.rrd"
    next_part(path).touch()
    assert next_part(path) == tmp_path / "run.part3.rrd"
    assert next_part(tmp_path / "new.rrd") == tmp_path / "new.rrd"


def test_a_place_that_cannot_be_written_is_an_os_error(configuration: Configuration, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError, match="file"):
        Recorder(configuration, tmp_path / "file" / "run.rrd")
    with pytest.raises(OSError, match="proc"):
        Recorder(configuration, Path("/proc/run.rrd"))


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("mount") is None, reason="a small disk needs root")
def test_a_full_disk_is_a_problem_that_says_so_and_stops_nothing(
    configuration: Configuration, tmp_path: Path, root: Path
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", disk], check=False).returncode != 0:
        pytest.skip("this machine does not let tests mount a disk")
    try:
        # in a process of its own: where Rerun hangs for ever, it does so again when Python ends
        command = [sys.executable, str(root / "tests" / "fill_disk.py"), str(configuration.path), str(disk / "x.rrd")]
        process = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert process.returncode == 0, process.stderr
        told = json.loads(process.stdout)
        (last,) = told["problems"]
        words = rf"{disk / 'x.rrd'} takes no more data: only (\d+) bytes are free there; messages that are lost: (\d+)"
        found = re.fullmatch(words, last)
        assert found is not None, last
        assert 0 < int(found[1]) < 2_000_000
        assert int(found[2]) > 100
        stored = read_raw(disk / "x.rrd")
        assert 0 < told["flushed"] + 1 <= sum("/truth/" in message.key for message in stored) < 400
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(configuration: Configuration, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    with pytest.raises(PermissionError):
        Recorder(configuration, closed / "run.rrd")


def test_a_missing_folder_is_made(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "a" / "b" / "run.rrd")
    recorder.close()
    recorder.close()
    assert read_raw(tmp_path / "a" / "b" / "run.rrd") == []


def test_run_properties_tell_how_to_compute_again(configuration: Configuration, tmp_path: Path) -> None:
    path = tmp_path / "x.rrd"
    Recorder(configuration, path, run_properties={"zenoh": "1.2.3"}).close()
    found: dict[str, Any] = {}
    for chunk in RrdReader(path).stream().filter(content="/__properties/**"):
        batch = chunk.to_record_batch()
        found |= {name: batch.column(name)[0].as_py() for name in batch.schema.names}
    assert found["zenoh"] == ["1.2.3"]
    assert found["configuration"] == [configuration.path.read_text()]
    assert found["model_digest"] == [configuration.digest()]
    assert found["seed"] == ["1"]
    assert found["numpy"] == [np.__version__]
    assert found["cpu"][0]


def test_no_network_is_opened_unless_asked(configuration: Configuration, tmp_path: Path) -> None:
    def listening() -> set[str]:
        rows = [
            line.split() for file in ("tcp", "tcp6") for line in Path(f"/proc/self/net/{file}").read_text().splitlines()
        ]
        inodes = {row[9]: row[1] for row in rows[1:] if len(row) > 9 and row[3] == "0A"}
        own = {os.readlink(entry) for entry in Path("/proc/self/fd").iterdir() if entry.exists()}
        return {address for inode, address in inodes.items() if f"socket:[{inode}]" in own}

    before = listening()
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    assert listening() == before
    recorder.close()


def test_every_entity_is_documented(configuration: Configuration, root: Path, record: Record) -> None:
    arrivals = SyntheticMesh(configuration).run(5)
    path = record(configuration, arrivals)
    listed = re.findall(r"`(/[a-z_/<>]+)`", (root / "docs" / "recording.md").read_text())
    patterns = [re.compile(re.sub("<[a-z]+>", "[^/]+", entry)) for entry in listed]
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    unknown = [e for e in entities if not e.startswith("/__properties") and not any(p.fullmatch(e) for p in patterns)]
    assert unknown == []
    unused = [p.pattern for p in patterns if not any(p.fullmatch(e) for e in entities)]
    rare = ("/raw/refused", "/half_widths/", "/factor/")
    assert [pattern for pattern in unused if not pattern.startswith(rare)] == []


@pytest.mark.parametrize(("states", "filters"), [(1, 1), (2, 12), (12, 2)])
def test_any_number_of_states_and_filters(states: int, filters: int, tmp_path: Path, record: Record) -> None:
    configuration = written(tmp_path, states, filters)
    arrivals = SyntheticMesh(configuration).run(12)
    path = record(configuration, arrivals)
    assert len(read_raw(path)) == len(arrivals)
    assert drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions")


def test_odd_names_of_states_do_not_collide(tmp_path: Path, record: Record) -> None:
    configuration = written(tmp_path)
    text = configuration.path.read_text().replace('["alpha", "beta", "gamma"]', '["Höhe/Rate", "x y", "x y"]')
    configuration.path.write_text(text)
    from lsu_mesh.mesh.config import load

    odd = load(configuration.path)
    path = record(odd, SyntheticMesh(odd).run(5))
    entities = {chunk.entity_path for chunk in RrdReader(path).stream() if chunk.entity_path.startswith("/truth/")}
    assert len(entities) == 3
