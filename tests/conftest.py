"""What all tests share."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def demo() -> Path:
    """The packaged configuration."""
    return ROOT / "services" / "lsu_mesh_services" / "demo.toml"


@pytest.fixture(scope="session")
def lsu_mesh_command() -> list[str]:
    """The command line of this checkout."""
    return [sys.executable, "-P", "-m", "lsu_mesh_services"]
