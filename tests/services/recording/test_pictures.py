"""Pictures of real meshes: the demo, a liar, two and six states, an aircraft. Nothing complains, everything is seen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from flights import convert_module, flight
from headless_viewer import HeadlessViewer, why_not
from local_mesh import LocalMesh
from lsu_mesh_services.recording.palette import TRUST, TRUTH, colors
from lsu_mesh_services.recording.recorder import Recorder
from pixels import Area, pixels

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Posterior, Prediction, encode

pytestmark = [
    pytest.mark.viewer,
    pytest.mark.skipif(why_not() is not None, reason=why_not() or ""),
]
SETS, PLOTS = Area(right=0.4, bottom=0.7), Area(left=0.41, bottom=0.73)
VOLUME = Area(left=0.41, right=0.9, top=0.772, bottom=0.95)
ARRIVAL_NS = 3_000_000
"""How long every message takes to the recorder."""

TWO_STATES = """
[mesh]
name = "cart"
dt = 0.1
steps = 120
seed = 3
[model]
A = [[1.0, 0.1], [-0.1, 0.97]]
B = [[0.005], [0.1]]
rho = [0.002, 0.03]
states = ["position", "velocity"]
units = ["m", "m/s"]
[model.prior]
lower = [-3.0, -2.0]
upper = [3.0, 2.0]
[plant]
x1 = [1.0, 0.0]
inputs = "sine"
[sensors.gps]
C = [[1.0, 0.0]]
r = [0.3]
[sensors.odometer]
C = [[0.0, 1.0]]
r = [0.2]
[filters.bundle]
kind = "LSUPB"
sensors = ["gps", "odometer"]
[filters.slow]
kind = "LSUCZ"
sensors = ["gps"]
[fusion.main]
sources = ["bundle", "slow"]
"""
SIX_STATES = """
[mesh]
name = "copter"
dt = 0.1
steps = 120
seed = 3
[model]
A = [
    [1.0, 0.0, 0.0, 0.1, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.1, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.1],
    [-0.05, 0.0, 0.0, 0.98, 0.0, 0.0], [0.0, -0.05, 0.0, 0.0, 0.98, 0.0], [0.0, 0.0, -0.05, 0.0, 0.0, 0.98],
]
rho = [0.01, 0.01, 0.01, 0.05, 0.05, 0.05]
states = ["x", "y", "z", "vx", "vy", "vz"]
units = ["m", "m", "m", "m/s", "m/s", "m/s"]
[model.prior]
lower = [-10.0, -10.0, -10.0, -3.0, -3.0, -3.0]
upper = [10.0, 10.0, 10.0, 3.0, 3.0, 3.0]
[plant]
[sensors.xy]
C = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]
r = [0.3, 0.3]
[sensors.height]
C = [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]
r = [0.1]
[sensors.flow]
C = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]
r = [0.3, 0.3, 0.3]
[filters.zonotope]
kind = "ZonotopicKalman"
sensors = ["xy", "height", "flow"]
box = false      # with its box the fused bounds are this filter's, and lie upon them
scaled = false
[filters.cz]
kind = "LSUCZ"
sensors = ["xy", "height"]
[fusion.main]
sources = ["zonotope", "cz"]
"""
LIE = 'sensors.c.faults=[{kind="drift", from=40, to=80, size=0.2}]'


@pytest.fixture(scope="module")
def viewer() -> Iterator[HeadlessViewer]:
    with HeadlessViewer() as started:
        yield started


def configuration_of(run: str, root: Path, folder: Path) -> Configuration:
    """The mesh of one of the runs."""
    if run == "demo":
        return load(root / "services" / "lsu_mesh_services" / "demo.toml", ["mesh.steps=120"])
    if run == "liar":
        return load(root / "examples" / "liar.toml", ["mesh.steps=120", LIE])
    if run == "flight":
        return flight(root, folder, convert_module(root), "aircraft_carrier", "mesh.steps=120")
    path = folder / "mesh.toml"
    path.write_text(TWO_STATES if run == "two states" else SIX_STATES)
    return load(path)


def recorded(configuration: Configuration, path: Path, unseen: str = "") -> Path:
    """A run of the mesh; the recorder misses the sets of the filter ``unseen``."""
    mesh, recorder = LocalMesh(configuration), Recorder(configuration, path)
    assert configuration.mesh.steps is not None
    mesh.run(configuration.mesh.steps / configuration.mesh.rate + 0.2)
    for role, name in configuration.peers():
        recorder.peer_changed(role, name, True, 0)
    for address, message in mesh.sent:
        if not (isinstance(message, Posterior | Prediction) and message.name == unseen):
            arrival = message.sent_ns + ARRIVAL_NS
            recorder.record(address, encode(message), arrival, message)
            recorder.tick(arrival)
    recorder.close()
    assert recorder.problems == []
    return path


def not_seen(viewer: HeadlessViewer, configuration: Configuration, folder: Path) -> list[str]:
    """Look at the overview and a filter's tab, and the fusion's of some: what ought to be there and is not."""
    is_flight = configuration.plant is None
    chosen, first = colors(configuration), "cz" if is_flight else next(iter(configuration.filters))
    tabs = {"Overview": "Overview", "filter": f"{first} ({configuration.filters[first].kind})"}
    if len(configuration.filters) > 2:
        tabs["Fusion"] = "Fusion"
    seen = {}
    for tab, title in tabs.items():
        viewer.show(title)
        seen[tab] = folder / f"{tab}.png"
        viewer.picture(seen[tab], settled=False)
    expected = [
        (f"{first}'s set in its tab", seen["filter"], chosen[first], SETS, 1500),
        (f"{first}'s bands in its tab", seen["filter"], chosen[first], PLOTS, 8000),
    ]
    if "Fusion" in tabs:
        expected += [
            ("the fused set in its tab", seen["Fusion"], chosen["main"], SETS, 400),
            ("the fused bands in their tab", seen["Fusion"], chosen["main"], PLOTS, 8000),
        ]
    for peer, color in chosen.items():
        if is_flight and peer == "cz":
            continue  # the fused bounds are this filter's, and lie upon them
        expected += [
            (f"{peer}'s set in the overview", seen["Overview"], color, SETS, 200),
            (f"{peer}'s bounds in the overview", seen["Overview"], color, PLOTS, 300),
            (f"{peer}'s log-volume in the overview", seen["Overview"], color, VOLUME, 30),
        ]
    if not is_flight:
        expected += [
            ("the truth in the plots", seen["Overview"], TRUTH, PLOTS, 300),
            ("the truth among the sets", seen["Overview"], TRUTH, SETS, 40),
        ]
    found = [(what, pixels(picture, color, area), least) for what, picture, color, area, least in expected]
    return [f"{what}: {count} pixels of {least}" for what, count, least in found if count < least]


@pytest.mark.parametrize("run", ["demo", "liar", "two states", "six states", "flight"])
def test_bands_and_sets_are_seen_and_nothing_complains(
    run: str, viewer: HeadlessViewer, root: Path, tmp_path: Path
) -> None:
    configuration = configuration_of(run, root, tmp_path)
    viewer.open(recorded(configuration, tmp_path / "run.rrd"))
    missing = not_seen(viewer, configuration, tmp_path)
    assert viewer.complaints() == []
    assert missing == []
    if run == "liar":
        sources = Area(right=0.4, top=0.8, bottom=0.97)
        assert pixels(tmp_path / "Fusion.png", TRUST["quarantined"], sources) > 1000, "the liar's lane says so"


def test_sets_that_are_not_there_are_missed(viewer: HeadlessViewer, root: Path, tmp_path: Path) -> None:
    """Guards the test above: the same pictures without the sets of one filter fail for these, and for nothing else."""
    configuration = configuration_of("demo", root, tmp_path)
    viewer.open(recorded(configuration, tmp_path / "without.rrd", unseen="box"))
    missing = [words.partition(":")[0] for words in not_seen(viewer, configuration, tmp_path)]
    assert sorted(missing) == sorted(
        [
            "box's set in its tab",
            "box's bands in its tab",
            "box's set in the overview",
            "box's bounds in the overview",
            "box's log-volume in the overview",
        ]
    )
