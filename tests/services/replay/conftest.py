"""The recorded demo."""

from __future__ import annotations

from pathlib import Path

import pytest
from local_mesh import LocalMesh
from recorded_mesh import record

from lsu_mesh.mesh.config import load


@pytest.fixture(scope="session")
def mesh(demo: Path) -> LocalMesh:
    """The demo after 60 steps."""
    mesh = LocalMesh(load(demo, ["mesh.steps=60"]))
    mesh.run(1.5)
    return mesh


@pytest.fixture(scope="session")
def recording(mesh: LocalMesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its recording."""
    return record(mesh, tmp_path_factory.mktemp("recorded") / "demo.rrd")
