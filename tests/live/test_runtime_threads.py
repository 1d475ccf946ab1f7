"""A peer gives Zenoh one thread, a router all that Zenoh takes, and the environment has the last word."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.live
OF_ZENOH = {"net", "rx", "tx", "acc"}
"""Its threads when nobody says otherwise; which of them it starts at once depends on what happens."""
PROGRAM = """
import os, time
from {module} import Bus, Clock, SessionSettings
with Bus(SessionSettings(), Clock()):
    time.sleep(0.5)  # a new thread names itself
    tasks = os.listdir("/proc/self/task")
    print(*{{open(f"/proc/self/task/{{task}}/comm").read().partition("-")[0].strip() for task in tasks}})
"""


def kinds_of_threads(root: Path, module: str, **environment: str) -> set[str]:
    """Names of the threads of a process with a session, without their numbers."""
    plain = {name: value for name, value in os.environ.items() if name != "ZENOH_RUNTIME"}
    path = os.pathsep.join([str(root), str(root / "services")])
    command = [sys.executable, "-c", PROGRAM.format(module=module)]
    done = subprocess.run(
        command,
        env={**plain, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return set(done.stdout.split())


def test_a_peer_gives_zenoh_one_runtime(root: Path) -> None:
    found = kinds_of_threads(root, "lsu_mesh_services.bus")
    assert "app" in found
    assert not found & OF_ZENOH


def test_a_router_and_the_environment_take_others(root: Path) -> None:
    assert kinds_of_threads(root, "lsu_mesh_services.commands.router") & OF_ZENOH
    assert kinds_of_threads(root, "lsu_mesh_services.bus", ZENOH_RUNTIME="()") & OF_ZENOH
