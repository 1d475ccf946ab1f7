"""Record into a disk that is too small: ``fill_disk.py MESH.toml FILE.rrd``; prints what is told, as JSON."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh

from lsu_mesh.mesh.config import load


def main(mesh: str, file: str) -> None:
    """Record 400 steps and close."""
    configuration = load(Path(mesh))
    recorder = Recorder(configuration, Path(file))
    arrivals = SyntheticMesh(configuration).run(400)
    for arrival in arrivals:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    print(json.dumps({"problems": recorder.problems, "flushed": recorder.flushed[arrivals[0].key]}), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
