"""The recorder follows the state of peers, and no message can stop it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from drawn import drawn, values_of
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.set_geometry import SetGeometry, body
from lsu_mesh_services.recording.synthetic_mesh import START_NS, STEP_NS, Arrival, SyntheticMesh

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Event, Health, Measurement, Rejection
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Record = Callable[[Configuration, Sequence[Arrival]], Path]


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
