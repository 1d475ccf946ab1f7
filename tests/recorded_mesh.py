"""Recordings of meshes that ran in one process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from local_mesh import LocalMesh
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import START_NS

from lsu_mesh.mesh.messages import Message, encode

Change = Callable[[Message, bytes], bytes]


def record(mesh: LocalMesh, path: Path, change: Change = lambda message, payload: payload) -> Path:
    """Everything that a mesh has published, as the recorder gets it; ``change`` tampers with payloads."""
    recorder = Recorder(mesh.configuration, path)
    for address, message in mesh.sent:
        arrival = START_NS + message.sent_ns
        recorder.record(address, change(message, encode(message)), arrival, message)
        recorder.tick(arrival)
    recorder.close()
    assert recorder.problems == []
    return path
