"""Meshes in one process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from local_mesh import Carry, LocalMesh

from lsu_mesh.mesh.config import load


@pytest.fixture
def mesh_of(demo: Path) -> Callable[..., LocalMesh]:
    """Make a mesh of the demo, with overrides such as ``"mesh.steps=50"``."""

    def make(*overrides: str, carry: Carry | None = None, file: Path = demo) -> LocalMesh:
        return LocalMesh(load(file, overrides), carry)

    return make


@pytest.fixture(scope="module")
def module_mesh(demo: Path) -> Callable[..., LocalMesh]:
    """Like ``mesh_of``, for meshes that all tests of a file look at."""

    def make(*overrides: str) -> LocalMesh:
        return LocalMesh(load(demo, overrides))

    return make
