"""What a sensor host pays for the client: disk, memory, time. One file that is copied, with zenoh and msgpack."""

from __future__ import annotations

import importlib.metadata
import json
import os
import shutil
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from ports import free_port
from waiting import until

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import key, model_key
from lsu_mesh.mesh.model_answer import encode_model, model_answer

pytestmark = pytest.mark.alone

MAX_DISK, MAX_RESIDENT, MAX_IMPORT_S = 60 * 10**6, 60 * 2**20, 0.2
PROGRAM = """
import json, sys, time
began = time.perf_counter()
from client import connect
took = time.perf_counter() - began
with connect(name="lab", entry=sys.argv[1]) as mesh:
    gauge = mesh.sensor("gauge")
    estimates = mesh.estimates("main")
    cpu = time.process_time()
    for i in range(500):
        gauge.publish(i * 0.01)
        time.sleep(0.01)
    cpu = time.process_time() - cpu
status = dict(line.split(":", 1) for line in open("/proc/self/status") if line.startswith("Vm"))
heavy = [name for name in ("numpy", "msgspec", "lsu_mesh", "lsu_mesh_services") if name in sys.modules]
peak = 1024 * int(status["VmHWM"].split()[0])
print(json.dumps({"import": took, "resident": peak, "cpu": cpu, "heavy": heavy}))
"""
MESH = """
[mesh]
name = "lab"
dt = 0.1
[model]
continuous = true
A = [[-1.0]]
rho = [0.1]
[model.prior]
lower = [0.0]
upper = [1.0]
[sensors.gauge]
source = "external"
C = [[1.0]]
r = [0.1]
[filters.main]
kind = "LSUO"
sensors = ["gauge"]
"""


@pytest.fixture
def endpoint(tmp_path: Path) -> Iterator[str]:
    """Where somebody tells the model, and listens to the sensor."""
    file, at = tmp_path / "mesh.toml", f"tcp/127.0.0.1:{free_port()}"
    file.write_text(MESH)
    configuration = load(file).started(1_700_000_000 * 10**9)
    answer = encode_model(model_answer(configuration))
    with Bus(SessionSettings(listen=(at,)), Clock()) as bus:
        bus.subscribe(key("lab", "measurement", "gauge"))
        bus.answer(model_key("lab"), lambda: (model_key("lab"), answer, "application/msgpack"))
        yield at
        until(lambda: bus.waiting() >= 500, "all measurements have come")


def test_a_sensor_host_is_small_and_quick(root: Path, tmp_path: Path, endpoint: str) -> None:
    shutil.copy(root / "services" / "lsu_mesh_services" / "client.py", tmp_path)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, "-c", PROGRAM, endpoint]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    imports = [found["import"], *(imported(tmp_path, environment) for _ in range(4))]
    print(f"\nresident {found['resident'] / 2**20:.1f} MiB, import {statistics.median(imports):.3f} s, "
          f"{found['cpu'] / 500 * 1e6:.0f} µs of processor a measurement at 100 Hz")  # fmt: skip
    assert found["heavy"] == []
    assert found["resident"] <= MAX_RESIDENT
    assert statistics.median(imports) < MAX_IMPORT_S


def imported(folder: Path, environment: dict[str, str]) -> float:
    """Seconds of the import in a new process."""
    program = "import time; began = time.perf_counter(); import client; print(time.perf_counter() - began)"
    command = [sys.executable, "-c", program]
    return float(subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=True).stdout)


def test_it_takes_little_disk(root: Path) -> None:
    size = (root / "services" / "lsu_mesh_services" / "client.py").stat().st_size
    for distribution in ("eclipse-zenoh", "msgpack"):
        files = importlib.metadata.files(distribution)
        assert files
        size += sum(Path(str(file.locate())).stat().st_size for file in files if Path(str(file.locate())).is_file())
    print(f"\n{size / 1e6:.1f} MB beside Python")
    assert size <= MAX_DISK
