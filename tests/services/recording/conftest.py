"""Recording a made-up mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
import rerun as rr
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import START_NS, Arrival, written

from lsu_mesh.mesh.config import Configuration, load


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Rerun raises where it would warn."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    """Three states, three filters, one fusion at 50 Hz, of which every step is drawn."""
    return load(written(tmp_path).path, ["recorder.draw_hz=50"])


@pytest.fixture
def record(tmp_path: Path) -> Callable[[Configuration, Sequence[Arrival]], Path]:
    """Records arrivals into a file, closes it, and insists that nothing went wrong."""

    def make(configuration: Configuration, arrivals: Sequence[Arrival]) -> Path:
        path = tmp_path / "made-up.rrd"
        recorder = Recorder(configuration, path)
        for role, name in configuration.peers():
            recorder.peer_changed(role, name, True, START_NS)
        for arrival in arrivals:
            recorder.record(*arrival)
            recorder.tick(arrival.arrival_ns)
        recorder.close()
        assert recorder.problems == []
        return path

    return make
