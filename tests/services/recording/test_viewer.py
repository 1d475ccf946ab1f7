"""Recordings open in the real viewer without a complaint, and the pictures show what they should."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb
from headless_viewer import HeadlessViewer, free_port, why_not
from lsu_mesh_services.recording.palette import TRUTH, colors
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import START_NS, STEP_NS, SyntheticMesh, written
from pixels import Area, pixels

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Event

pytestmark = [
    pytest.mark.viewer,
    pytest.mark.skipif(why_not() is not None, reason=why_not() or ""),
]

LEFT, RIGHT = Area(right=0.4), Area(left=0.4)
"""Sets, and plots."""


@pytest.fixture(scope="module")
def viewer() -> Iterator[HeadlessViewer]:
    with HeadlessViewer() as started:
        yield started


def recorded(configuration: Configuration, path: Path, steps: int = 160) -> Path:
    """A run in which a filter dies and an event is told."""
    mesh, recorder = SyntheticMesh(configuration), Recorder(configuration, path)
    for role, name in configuration.peers():
        recorder.peer_changed(role, name, True, START_NS)
    arrivals = mesh.run(steps)
    stamp = mesh.stamp("event", "filter/f1", steps // 2)
    event = Event(**stamp, level="WARN", code="contradiction", text="the strip misses the set", about={"sensor": "s1"})
    for arrival in [*arrivals, mesh.arrival(event, steps)]:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.peer_changed("sensor", "s1", False, START_NS + steps * STEP_NS)
    recorder.close()
    assert recorder.problems == []
    return path


def test_every_tab_of_three_states_is_drawn_without_a_complaint(viewer: HeadlessViewer, tmp_path: Path) -> None:
    configuration = written(tmp_path)
    viewer.open(recorded(configuration, tmp_path / "three.rrd"))
    filters = ["f1 (LSUO)", "f2 (LSUP)", "f3 (LSUCZ)"]
    assert viewer.tabs() == ["Overview", *filters, "Fusion", "Outputs", "Mesh", "Events"]
    seen = pictures(viewer, viewer.tabs(), tmp_path)
    assert viewer.complaints() == []
    chosen = colors(configuration)
    for name, tab in zip(("f1", "f2", "f3"), filters, strict=True):
        assert pixels(seen["Overview"], chosen[name], LEFT) > 300, "the set of every filter has edges"
        assert pixels(seen["Overview"], chosen[name], RIGHT) > 300, "the bounds of every filter are lines"
        assert pixels(seen[tab], chosen[name], LEFT) > 1000, "the filter's own tab shows its set"
        assert pixels(seen[tab], chosen[name], RIGHT) > 5000, "the filter's own tab shows its bands"
        assert pixels(seen["Outputs"], chosen[name]) > 300, "the predicted outputs are there"
    assert pixels(seen["Overview"], chosen["main"], LEFT) > 1000, "the fused set is among them"
    assert pixels(seen["Fusion"], chosen["main"], RIGHT) > 5000, "the fused bands are there"
    assert pixels(seen["Mesh"], (0, 160, 80), Area(0.5)) > 10000, "the lanes are green"
    assert pixels(seen["Events"], (255, 130, 0)) > 20, "a warning is orange"


@pytest.mark.parametrize(("states", "filters"), [(1, 1), (2, 2), (6, 4), (12, 12)])
def test_other_sizes_are_drawn_without_a_complaint(
    states: int, filters: int, viewer: HeadlessViewer, tmp_path: Path
) -> None:
    configuration = written(tmp_path, states, filters)
    viewer.open(recorded(configuration, tmp_path / "other.rrd"))
    assert len(viewer.tabs()) == filters + 5 + (states > 6)
    seen = pictures(viewer, ["Overview", "f1 (LSUO)"], tmp_path)
    assert viewer.complaints() == []
    chosen = colors(configuration)
    assert pixels(seen["Overview"], TRUTH, RIGHT) > 300, "the truth is a line in the plots"
    assert pixels(seen["Overview"], chosen["main"], RIGHT) > 3000, "the fused bands are there"
    assert pixels(seen["Overview"], chosen["main"], LEFT) > 100, "the fused set is there"
    assert pixels(seen["f1 (LSUO)"], chosen["f1"], LEFT) > 1000, "the filter's set is there"


def pictures(viewer: HeadlessViewer, tabs: list[str], folder: Path) -> dict[str, Path]:
    """A picture of every tab."""
    taken = {tab: folder / f"{tab}.png" for tab in tabs}
    for tab, picture in taken.items():
        viewer.show(tab)
        viewer.picture(picture, settled=False)
    return taken


def test_a_viewer_that_follows_and_freezes_disturbs_nothing(viewer: HeadlessViewer, tmp_path: Path) -> None:
    configuration = written(tmp_path, 2, 2)
    port = free_port()
    recorder, mesh = Recorder(configuration, tmp_path / "live.rrd", serve_port=port), SyntheticMesh(configuration)

    def go_on(steps: range) -> float:
        """The longest time that a step took."""
        longest = 0.0
        for k in steps:
            began = time.perf_counter()
            for arrival in mesh.step(k):
                recorder.record(*arrival)
            recorder.tick(arrival.arrival_ns)
            longest = max(longest, time.perf_counter() - began)
            time.sleep(0.01)
        return longest

    go_on(range(1, 60))
    viewer.follow(f"rerun+http://127.0.0.1:{port}/proxy")
    go_on(range(60, 120))
    viewer.picture(tmp_path / "live.png", settled=False)
    assert viewer.last_step() > 60
    assert viewer.complaints() == []
    assert pixels(tmp_path / "live.png", colors(configuration)["main"], RIGHT) > 1000
    with viewer.frozen():
        assert go_on(range(120, 320)) < 1.0
    recorder.close()
    assert recorder.problems == []
    assert sum("/truth/" in message.key for message in read_raw(recorder.path)) == 319


def test_no_analytics_are_written_or_sent(viewer: HeadlessViewer) -> None:
    assert viewer.home.is_dir()
    assert not list(viewer.home.rglob("*analytics*"))


def test_the_viewer_does_complain_of_a_broken_recording(viewer: HeadlessViewer, tmp_path: Path) -> None:
    """Guards the tests above: silence means something only where complaints are heard."""
    stream = rr.RecordingStream("broken")
    stream.set_sinks(rr.FileSink(tmp_path / "broken.rrd"), default_blueprint=rrb.Tabs(rrb.Spatial3DView(name="broken")))
    stream.log("mesh", rr.Mesh3D(vertex_positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangle_indices=[[0, 1, 99]]))
    stream.disconnect()
    viewer.open(tmp_path / "broken.rrd")
    viewer.picture(tmp_path / "broken.png", settled=False)
    assert any("broken" in complaint or "mesh" in complaint for complaint in viewer.complaints())
