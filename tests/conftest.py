"""What all tests share."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import hypothesis
import pytest

ROOT = Path(__file__).resolve().parent.parent

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell starts background commands (``nohup``, ``&``) with Ctrl-C ignored, and children inherit that through exec:
    # no process of a live test would then stop when the test sends it SIGINT.
    signal.signal(signal.SIGINT, signal.default_int_handler)

hypothesis.settings.register_profile("same", derandomize=True, database=None)
hypothesis.settings.register_profile("new", print_blob=True)
hypothesis.settings.load_profile("same")
"""Ordinary runs draw the same cases each time; ``--hypothesis-profile=new``, as in ``make soak``, draws new ones."""


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
