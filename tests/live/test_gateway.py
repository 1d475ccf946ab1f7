"""The gateway beside a real mesh: bands, health, measurements, and clients that cost the mesh nothing."""

from __future__ import annotations

import itertools
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from external_mesh import ExternalMesh
from gateway_mesh import MESH, START_NS
from gateway_process import Gateway
from live_mesh import LiveMesh
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.commands.keys import make_files
from lsu_mesh_services.network.certificate_authority import LOOPBACK_HOSTS
from lsu_mesh_services.network.security import certificates
from lsu_mesh_services.supervisor import Child
from ports import free_port
from waiting import until

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Measurement, decode

pytestmark = pytest.mark.live
TOPICS = ("fused", "health", "event")


def beside(mesh: LiveMesh, folder: Path) -> Gateway:
    """A gateway of this mesh."""
    configuration = mesh.configuration
    return Gateway(folder, ["-c", str(configuration.path), "-X", f"network.entry={configuration.network.entry}"])


def test_bands_health_and_events_of_a_real_mesh(tmp_path: Path) -> None:
    with LiveMesh(tmp_path, ["filters.cz.reset_after=3"], topics=TOPICS) as mesh, beside(mesh, tmp_path) as gateway:
        with gateway.stream("/estimates/main") as stream:
            bands = [told for _, _, told in itertools.islice(stream, 100)]
        assert {band["name"] for band in bands} == {"main"}
        numbers = [int(band["seq"]) for band in bands]
        assert numbers == list(range(numbers[0], numbers[0] + 100)), "every one that was published, once"
        assert all(low < high for band in bands for low, high in zip(band["lower"], band["upper"], strict=True))
        assert all(len(band["sent_ns"]) == 19 for band in bands)
        with gateway.stream("/estimates?rate=5&full=1") as stream:
            whole = [told for _, _, told in itertools.islice(stream, 12)]
        assert {band["name"] for band in whole} == {"main", "box", "para", "cz"}
        assert all(band["support"]["type"] for band in whole)

        until(lambda: set(gateway.levels().values()) == {"OK"}, "all peers are well", 60)
        assert gateway.ask("GET", "/health")[0] == 200
        mesh.process("box").kill()
        until(lambda: gateway.levels()["box"] == "STALE", "a killed filter is seen", 2)
        assert gateway.ask("GET", "/health")[0] == 503
        until(lambda: mesh.supervisor.watch(time.monotonic()) == [], "it is started again")
        until(lambda: gateway.levels()["box"] == "OK", "it was started again", 60)
        assert gateway.stop() == 0


@contextmanager
def listening(configuration: Configuration) -> Iterator[Bus]:
    """A peer of the mesh that hears measurements, and is its entry."""
    entry = configuration.network.entry
    files = certificates(configuration, "box")
    with Bus(SessionSettings((), (entry,), certificates=files), Clock()) as bus:
        bus.subscribe(key(configuration.mesh.name, "measurement", "*"))
        yield bus


@pytest.mark.parametrize("secure", [False, True], ids=["tcp", "tls"])
def test_a_measurement_reaches_the_mesh_as_the_sensor_would_send_it(tmp_path: Path, secure: bool) -> None:
    (tmp_path / "file.csv").write_text("step,y\n1,0.5\n2,0.6\n")
    (tmp_path / "mesh.toml").write_text(MESH)
    overrides = [f"network.entry={'tls' if secure else 'tcp'}/127.0.0.1:{free_port()}"]
    overrides += ["network.tls.enabled=true"] if secure else []
    configuration = load(tmp_path / "mesh.toml", overrides)
    if secure:
        make_files(configuration, LOOPBACK_HOSTS, days=2)
    arguments = ["-c", "mesh.toml", *(word for one in overrides for word in ("-X", one))]
    with listening(configuration) as bus, Gateway(tmp_path, arguments) as gateway:
        until(lambda: gateway.health()["links"] > 0, "it is connected")
        token = (tmp_path / "mesh.gateway-token").read_text().strip()
        body = {"y": [1.5, None], "time": "2026-05-01T12:00:00.25Z", "time_error": "2ms"}
        status, told = gateway.ask("POST", "/measurements/gauge", body, authorization=f"Bearer {token}")
        assert (status, told["step"]) == (202, 3), told
        arrival = bus.next(20.0)
        assert arrival is not None
        assert arrival.key == "lsu/v1/lab/measurement/gauge"
        message = decode("measurement", arrival.payload)
        assert isinstance(message, Measurement)
        assert (message.src, message.step, message.seq) == ("sensor/gauge", 0, 0)
        assert (message.y, message.time_ns, message.time_error_ns) == ([1.5, None], START_NS + 250_000_000, 2_000_000)
        assert (message.boot, message.model) == (told["boot"], configuration.digest())
        assert gateway.ask("POST", "/measurements/gauge", body)[0] == 401
        assert gateway.stop() == 0


def test_with_tls_the_gateway_publishes_only_where_it_has_the_certificate(tmp_path: Path) -> None:
    (tmp_path / "file.csv").write_text("step,y\n1,0.5\n2,0.6\n")
    (tmp_path / "mesh.toml").write_text(MESH)
    overrides = [f"network.entry=tls/127.0.0.1:{free_port()}", "network.tls.enabled=true"]
    configuration = load(tmp_path / "mesh.toml", overrides)
    make_files(configuration, LOOPBACK_HOSTS, days=2)
    (tmp_path / "keys" / "gauge.key").unlink()
    arguments = ["-c", "mesh.toml", *(word for one in overrides for word in ("-X", one))]
    with listening(configuration) as bus, Gateway(tmp_path, arguments) as gateway:
        until(lambda: gateway.health()["links"] > 0, "it is connected")
        token = (tmp_path / "mesh.gateway-token").read_text().strip()
        status, told = gateway.ask("POST", "/measurements/gauge", {"y": [1, 2]}, authorization=f"Bearer {token}")
        assert status == 403
        assert "with TLS, the gateway may publish only where its certificate allows" in told["error"]
        assert "gauge.key" in told["error"]
        assert bus.next(0.5) is None


def test_a_filter_uses_what_was_sent_over_http(tmp_path: Path) -> None:
    """A mesh that agrees on its start when it begins; the gateway learns it, and learns the next one."""
    with ExternalMesh(tmp_path) as mesh:
        arguments = ["-c", str(mesh.file), "-X", f"network.entry={mesh.entry}"]
        with Gateway(tmp_path, arguments) as gateway:
            until(lambda: gateway.health()["links"] > 0, "it is connected")
            token = (tmp_path / "mesh.gateway-token").read_text().strip()
            allowed = {"authorization": f"Bearer {token}"}
            status, told = gateway.ask("POST", "/measurements/gauge", {"y": [0.0]}, **allowed)
            assert (status, "has told when it started" in told["error"]) == (503, True)
            boots = set[str]()
            for _ in range(2):
                children = [mesh.start("fusion", "main"), mesh.start("filter", "box")]
                seen = estimates_by_http(gateway, allowed, boots)
                boots |= {one["boot"] for one in seen}
                assert all(one["lower"][0] < 0.5 < one["upper"][0] for one in seen)
                for child in children:
                    ended(mesh, child)
            assert len(boots) == 2
            assert gateway.stop() == 0


def ended(mesh: ExternalMesh, child: Child) -> None:
    """Kill a peer; nobody starts it again."""
    assert child.process is not None
    assert child.reader is not None
    mesh.supervisor.children.remove(child)
    child.process.kill()
    child.process.wait()
    child.reader.join(timeout=10)


def estimates_by_http(gateway: Gateway, allowed: dict[str, str], earlier: set[str]) -> list[Any]:
    """Ten estimates of a filter that was not there earlier, each made of both sensors that are sent meanwhile."""
    seen: list[Any] = []

    def read() -> None:
        with gateway.stream("/estimates/box?full=1") as stream:
            for _, _, told in stream:
                sources = {reference[1] for reference in told["used"]}
                if told["boot"] not in earlier and sources == {"sensor/gauge", "sensor/speed"}:
                    seen.append(told)
                if len(seen) == 10:
                    return

    def sent() -> bool:
        for name, value in (("gauge", 0.5), ("speed", 0.0)):
            gateway.ask("POST", f"/measurements/{name}", {"y": [value], "time": "now"}, **allowed)
        return len(seen) == 10

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    until(sent, "the filter uses what was sent", 60, 0.03)
    reader.join(timeout=10)
    return seen


def latency_ms(mesh: LiveMesh, seconds: float) -> float:
    """Median from the oldest measurement of a step to its first fused set, in the mesh itself."""
    begin = len(mesh.observer.estimates["main"])
    time.sleep(seconds)
    first = {}
    for one in mesh.observer.estimates["main"][begin:]:
        first.setdefault(one.message.step, one.message)
    assert len(first) > seconds * mesh.configuration.mesh.rate / 2, "the mesh keeps its rate"
    return statistics.median(message.sent_ns - message.origin_ns for message in first.values()) * 1e-6


@contextmanager
def idle_clients(gateway: Gateway, count: int) -> Iterator[None]:
    """So many clients that listen, and one that never reads."""
    script = Path(__file__).parent.parent / "idle_clients.py"
    command = [sys.executable, "-P", str(script), str(count), str(gateway.port)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "open\n"
        yield
        process.stdin.close()
        assert int(process.stdout.readline()) > 1000, "something came to each of those that read"


@pytest.mark.alone
def test_two_hundred_clients_and_one_that_never_reads_do_not_delay_the_mesh(tmp_path: Path) -> None:
    without, crowded = [], []
    with LiveMesh(tmp_path, topics=TOPICS) as mesh, beside(mesh, tmp_path) as gateway:
        until(lambda: set(gateway.levels().values()) == {"OK"}, "all peers are well", 60)
        for _ in range(3):
            without.append(latency_ms(mesh, 3.0))
            with idle_clients(gateway, 200):
                crowded.append(latency_ms(mesh, 3.0))
                assert "lsu_gateway_clients 201.0" in gateway.ask("GET", "/metrics")[1]
            until(lambda: "lsu_gateway_clients 0.0" in gateway.ask("GET", "/metrics")[1], "all have left")
        assert mesh.gaps()["main"] == 0
        print(f"latency without {without} ms, with clients {crowded} ms")
        assert min(crowded) < 1.5 * min(without) + 2.0, (without, crowded)
