"""How a process is asked to end, and how it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

WAITING = """
import sys, time
from lsu_mesh_services.stop import Stop
stop = Stop()
print("ready", flush=True)
while not stop:
    time.sleep(0.01)
print("asked", flush=True)
if "again" in sys.argv:
    while True:
        time.sleep(0.01)
"""
LEAVING = """
import atexit, sys
from lsu_mesh_services.stop import leave
atexit.register(lambda: print("cleaned up"))
if "zenoh" in sys.argv:
    sys.modules["zenoh"] = sys
print("said", end="")
leave(4)
"""


def begun(root: Path, program: str, *words: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(root)}
    return subprocess.Popen([sys.executable, "-c", program, *words], text=True, stdout=-1, stderr=-1, env=environment)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks(root: Path, number: int) -> None:
    with begun(root, WAITING) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)
        assert process.communicate(timeout=20)[0] == "asked\n"
    assert process.returncode == 0


def test_the_second_interrupt_ends_at_once(root: Path) -> None:
    with begun(root, WAITING, "again") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "asked\n"
        process.send_signal(signal.SIGINT)
        process.wait(timeout=20)
    assert process.returncode == 130


def test_a_process_with_a_session_leaves_without_waiting_for_the_threads_of_zenoh(root: Path) -> None:
    with begun(root, LEAVING, "zenoh") as process:
        assert process.communicate(timeout=20) == ("said", ""), "what was written is not lost"
    assert process.returncode == 4


def test_other_processes_end_as_always(root: Path) -> None:
    with begun(root, LEAVING) as process:
        assert process.communicate(timeout=20) == ("saidcleaned up\n", "")
    assert process.returncode == 4


def test_a_reader_that_has_gone_makes_it_a_failure_and_no_trouble(root: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONUNBUFFERED": ""}
    program = LEAVING.replace("leave(4)", "leave(0)")
    result = subprocess.run(
        [sys.executable, "-c", program, "zenoh"], stdout=write, stderr=-1, text=True, env=environment, check=False
    )
    os.close(write)
    assert (result.returncode, result.stderr) == (1, "")
