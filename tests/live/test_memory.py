"""What the processes of a mesh take: those that run no filter are small."""

from __future__ import annotations

import sys
import time

import psutil
import pytest

pytestmark = [
    pytest.mark.live,
    pytest.mark.skipif(sys.platform != "linux", reason="pages are counted in different ways elsewhere"),
]

MAX_SENSOR = 60 * 2**20
"""numba, a kernel and SciPy, which a sensor does without, take 100 MiB more."""
MAX_RUN = 75 * 2**20
FLOWS_S = 8.0
"""From the first step on, so that queues, caches and buffers are in use."""


def highest(processes: list[psutil.Process], seconds: float) -> int:
    """The largest resident size of any of them, in bytes, looked at until the end."""
    end, most = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        most = max(most, *(process.memory_info().rss for process in processes))
        time.sleep(0.2)
    return most


def loaded(process: psutil.Process) -> set[str]:
    """Which of the packages a process has mapped a library of."""
    paths = [mapped.path for mapped in process.memory_maps()]
    return {name for name in ("numba", "llvmlite", "scipy") if any(f"/{name}/" in path for path in paths)}


def test_plant_sensors_and_launcher_of_a_run_are_small(start_run) -> None:  # type: ignore[no-untyped-def]
    session = start_run("--no-record", "--steps", "100000")
    small = [session.child(words) for words in ("plant plant", "sensor s1", "sensor s2", "sensor s3")]
    session.child("fusion main")  # is forked when the kernels are loaded
    launcher = psutil.Process(session.process.pid)
    most = highest(small, FLOWS_S)
    assert most <= MAX_SENSOR, f"{most / 2**20:.1f} MiB"
    most = highest([launcher], 0.5)
    assert most <= MAX_RUN, f"{most / 2**20:.1f} MiB"
    assert not any(loaded(process) for process in (*small, launcher))
    assert "llvmlite" in loaded(session.child("filter cz")), "the check above can fail"


def test_a_sensor_that_is_started_by_hand_is_small(start) -> None:  # type: ignore[no-untyped-def]
    plant = start("plant", "-l", "{endpoint}", "-e", "{endpoint}", "-X", "mesh.steps=100000")
    sensor = start("sensor", "s1", "-l", "tcp/127.0.0.1:0", "-e", plant.endpoint, endpoint=plant.endpoint)
    process = psutil.Process(sensor.process.pid)
    end = time.monotonic() + 60.0
    while len(process.net_connections("tcp")) < 2:
        assert time.monotonic() < end, "the sensor does not reach the plant"
        assert sensor.process.poll() is None, sensor.process.communicate()
        time.sleep(0.1)
    most = highest([process], FLOWS_S)
    assert most <= MAX_SENSOR, f"{most / 2**20:.1f} MiB"
    assert not loaded(process)
