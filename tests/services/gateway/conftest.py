"""A board of a small mesh, and messages for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from gateway_mesh import MESH, START_NS
from lsu_mesh_services.gateway.board import Board

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import Message


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    (tmp_path / "file.csv").write_text("step,y\n1,0.5\n2,0.6\n")
    (tmp_path / "mesh.toml").write_text(MESH)
    return load(tmp_path / "mesh.toml")


@pytest.fixture
def board(configuration: Configuration) -> Board:
    return Board(configuration, now=START_NS)


Make = Callable[..., Message]


@pytest.fixture
def message() -> Make:
    """A message of a topic with other values."""

    def made(topic: str, **values: Any) -> Message:
        plain = {name: getattr(example(topic), name) for name in example(topic).__struct_fields__}
        return type(example(topic))(**plain | values)

    return made
