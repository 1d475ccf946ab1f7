"""A node of ROS 2 in plain zenoh, heard by a real sensor process: nothing lost, every value and time exact."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import psutil
import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from ports import free_port

pytestmark = pytest.mark.live

Start = Callable[..., Any]
TESTS = Path(__file__).parents[1]
MESH = """
[mesh]
name = "robot"
dt = 0.1
start_time = {start}
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [1.0e6]
[model.prior]
lower = [-1.0e6, -1.0e6]
upper = [1.0e6, 1.0e6]
[sensors.gps]
source = "ros2"
topic = "/fix"
type = "sensor_msgs/msg/NavSatFix"
fields = ["latitude"]
C = [[1.0, 0.0]]
r = [0.5]
[filters.main]
kind = "LSUPB"
sensors = ["gps"]
[network]
entry = "{entry}"
[network.ros2]
connect = ["{ros2}"]
"""


class Robot:
    """The talker, and what a subscriber of the mesh got."""

    def __init__(self, folder: Path, role: str, dialect: str, hz: float, count: int) -> None:
        self.entry, self.ros2 = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
        start_s = int(time.time()) - 1
        self.start_ns = start_s * 10**9
        text = MESH.format(start=start_s, entry=self.entry, ros2=self.ros2)
        self.mesh = folder / "mesh.toml"
        self.mesh.write_text(f'{text}dialect = "{dialect}"\n')
        words = [sys.executable, str(TESTS / "ros2_talker.py"), self.ros2, role, dialect, str(hz), str(count)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])}
        self.talker = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        self.count = count

    def said(self) -> str:
        assert self.talker.stdout is not None
        return self.talker.stdout.readline().strip()


DT_NS = 10**8
SETTLED = 10
"""Steps after which sensor and filter surely have a link; live data are taken from no cache."""
Measured = list[dict[str, Any]]


def heard(bus: Bus, key: str, count: int, within_s: float = 60.0) -> Measured:
    """Messages of a key until there are so many, or nothing has come for a while."""
    found, end = [], time.monotonic() + within_s
    while len(found) < count and time.monotonic() < end:
        arrival = bus.next(0.5)
        if arrival is not None and arrival.what == "sample" and arrival.key == key:
            found.append(msgpack.unpackb(arrival.payload))
    return found


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Callable[..., Robot]]:
    made: list[Robot] = []

    def make(role: str = "peer", dialect: str = "rmw_zenoh", hz: float = 1000.0, count: int = 3000) -> Robot:
        made.append(Robot(tmp_path, role, dialect, hz, count))
        return made[-1]

    yield make
    for one in made:
        one.talker.kill()
        one.talker.communicate()


def health_of(bus: Bus, until: Callable[[dict[str, Any]], bool], within_s: float = 30.0) -> dict[str, Any]:
    end, last = time.monotonic() + within_s, {}
    while time.monotonic() < end:
        arrival = bus.next(0.5)
        if arrival is not None and arrival.what == "sample" and "/health/gps" in arrival.key:
            last = msgpack.unpackb(arrival.payload)
            if until(last):
                return last
    raise AssertionError(last)


@pytest.mark.parametrize(("role", "dialect"), [("peer", "rmw_zenoh"), ("router", "rmw_zenoh"), ("router", "ros2dds")])
def test_nothing_is_lost_at_a_thousand_a_second(
    start: Start, robot: Callable[..., Robot], role: str, dialect: str
) -> None:
    one = robot(role, dialect)
    settings = SessionSettings(listen=(one.entry,), cache=10 * one.count)
    with Bus(settings, Clock()) as bus:
        bus.subscribe("lsu/v1/robot/*/gps")
        start("sensor", "gps", "-c", str(one.mesh))
        assert one.said() == "listened to"
        found = heard(bus, "lsu/v1/robot/measurement/gps", one.count)
        stamps = json.loads(one.said())["stamps"]
        assert [message["y"] for message in found] == [[float(i)] for i in range(one.count)]
        assert [message["time_ns"] for message in found] == stamps
        assert {(message["step"], message["time_error_ns"]) for message in found} == {(0, 0)}
        health = health_of(bus, lambda one: one["counters"].get("ros2 received") == len(stamps))
        assert "ros2 lost" not in health["counters"]
        assert health["counters"]["links"] >= 1


def test_health_says_why_nothing_comes(start: Start, robot: Callable[..., Robot]) -> None:
    one = robot(count=1)
    with Bus(SessionSettings(listen=(one.entry,)), Clock()) as bus:
        bus.subscribe("lsu/v1/robot/*/gps")
        elsewhere = f"tcp/127.0.0.1:{free_port()}"
        lonely = start("sensor", "gps", "-c", str(one.mesh), "-X", f'network.ros2.connect=["{elsewhere}"]')
        health = health_of(bus, lambda one: any("no link to ROS 2" in reason for reason in one["reasons"]))
        assert any(elsewhere in reason for reason in health["reasons"])
        lonely.process.kill()
        lonely.process.communicate()
        wrong = start("sensor", "gps", "-c", str(one.mesh), "-X", 'sensors.gps.topic="/fxi"')
        health_of(bus, lambda one: any("no publisher of it in domain 0" in reason for reason in one["reasons"]))
        wrong.process.kill()
        wrong.process.communicate()
        start("sensor", "gps", "-c", str(one.mesh), "-X", 'network.ros2.distro="humble"')
        health = health_of(bus, lambda one: any("sent by a later release" in reason for reason in one["reasons"]))
        assert health["counters"]["ros2 refused: type"] == 1


def test_a_mesh_estimates_from_it(start: Start, robot: Callable[..., Robot]) -> None:
    one = robot(hz=50.0, count=200)
    with Bus(SessionSettings(listen=(one.entry,)), Clock()) as bus:
        bus.subscribe("lsu/v1/robot/*/main")
        start("filter", "main", "-c", str(one.mesh))
        while (arrival := bus.next(60.0)) is not None and "/health/" not in arrival.key:
            pass
        start("sensor", "gps", "-c", str(one.mesh))
        assert one.said() == "listened to"
        stamps = json.loads(one.said())["stamps"]
        steps = [-((one.start_ns - stamp) // DT_NS) for stamp in stamps]
        wanted = {k: steps.count(k) for k in range(steps[0] + SETTLED, steps[-1] + 1)}
        used: dict[int, int] = {}
        end = time.monotonic() + 30.0
        while used != wanted and time.monotonic() < end:
            arrival = bus.next(0.5)
            if arrival is not None and arrival.what == "sample":
                message = msgpack.unpackb(arrival.payload)
                if "/posterior/" in arrival.key and message["step"] in wanted:
                    used[message["step"]] = sum(source == "sensor/gps" for _, source, *_ in message["used"])
        assert used == wanted


@pytest.mark.alone
def test_a_hundred_a_second_cost_a_tenth_of_a_core(start: Start, robot: Callable[..., Robot]) -> None:
    one = robot(hz=100.0, count=1500)
    with Bus(SessionSettings(listen=(one.entry,)), Clock()) as bus:
        bus.subscribe("lsu/v1/robot/measurement/gps")
        session = start("sensor", "gps", "-c", str(one.mesh))
        assert one.said() == "listened to"
        heard(bus, "lsu/v1/robot/measurement/gps", 200)
        process = psutil.Process(session.process.pid)
        begin, used = time.monotonic(), sum(process.cpu_times()[:2])
        heard(bus, "lsu/v1/robot/measurement/gps", 1000)
        share = (sum(process.cpu_times()[:2]) - used) / (time.monotonic() - begin)
        print(f"share of a core at 100 Hz: {share:.3f}")
        assert share <= 0.1
