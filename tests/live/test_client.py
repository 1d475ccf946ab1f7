"""Sensors of one's own on a real mesh: by the client, by a pipe, and when the mesh or the sensor begins anew."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.client import Estimate, Mesh, NoMesh, NotAllowed, Source, Stream, connect
from lsu_mesh_services.network.certificate_authority import Authority
from ports import free_port
from waiting import WITHIN

pytestmark = pytest.mark.live

Start = Callable[..., Any]
TRUTH, R = 3.0, 0.5


@pytest.fixture
def mesh_file(lsu_mesh_command: list[str], root: Path, tmp_path: Path) -> Path:
    """What ``new --from external`` writes, on a free port."""
    file = tmp_path / "mesh.toml"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), str(root / "services")])}
    command = [*lsu_mesh_command, "new", str(file), "--from", "external"]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    file.write_text(f'{file.read_text()}\n[network]\nentry = "tcp/127.0.0.1:{free_port()}"\n')
    return file


@contextmanager
def sending(gauge: Source) -> Iterator[None]:
    """Measure the truth, wrong by up to 0.4, every 50 ms."""
    is_over = threading.Event()

    def send() -> None:
        i = 0
        while not is_over.wait(0.05):
            gauge.publish(TRUTH + (0.4, -0.4)[i % 2])
            i += 1

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        is_over.set()
        sender.join()


def good(estimates: Stream[Estimate], count: int) -> list[Estimate]:
    """So many estimates with data in them; each holds the truth."""
    found: list[Estimate] = []
    end = time.monotonic() + 2 * WITHIN
    while len(found) < count:
        assert time.monotonic() < end, f"{len(found)} of {count} estimates"
        one = estimates.next(0.5)
        if one is not None:
            assert one.lower[0] <= TRUTH <= one.upper[0]
            found += [one] if one.status == "ok" else []
    return found


def run(start: Start, file: Path) -> Any:
    return start("run", str(file), "--no-record")


def test_a_sensor_by_the_client_and_a_mesh_that_begins_anew(start: Start, mesh_file: Path) -> None:
    first = run(start, mesh_file)
    with connect(mesh_file, wait=2 * WITHIN) as mesh:
        gauge, estimates = mesh.sensor("gauge"), mesh.estimates("main")
        digest = mesh.model().digest
        with sending(gauge):
            found = good(estimates, 20)
            assert [one.step for one in found] == sorted(one.step for one in found)
            for one in found:
                assert one.time_ns is not None
                assert abs(one.time_ns - one.raw["sent_ns"]) < 5_000_000_000
                assert (one.guarantee, one.support["type"]) == ("declared", "constrained_zonotope")
            latest = mesh.latest("main")
            assert latest is not None
            assert latest.step >= found[-1].step
            health = start("health", "-c", str(mesh_file), "-X", "recorder.path=x.rrd", "--json")
            health.wait()
            told = {peer["name"]: peer for peer in map(json.loads, health.output[0].splitlines())}
            assert (told["gauge"]["level"], told["gauge"]["role"]) == ("OK", "sensor"), health.output
            assert told["gauge"]["counters"]["published"] > 20
            first.process.send_signal(signal.SIGINT)
            first.wait()
            run(start, mesh_file)
            until_other(mesh, digest)
            good(estimates, 20)
        assert gauge.counters["refused"] == 0


def until_other(mesh: Mesh, digest: str) -> None:
    """Wait for a mesh that began at another time."""
    end = time.monotonic() + 2 * WITHIN
    while mesh.model().digest == digest:
        assert time.monotonic() < end, "the new mesh is not followed"
        time.sleep(0.05)


def test_a_pipe_is_a_sensor_and_a_wrong_line_is_named(start: Start, mesh_file: Path) -> None:
    run(start, mesh_file)
    publish = [sys.executable, "-P", "-m", "lsu_mesh_services", "publish", "gauge", "-c", str(mesh_file)]
    program = 'BEGIN { while (1) { print 3 + (i++ % 2) / 5; fflush(); system("sleep 0.05") } }'
    with (
        connect(mesh_file, wait=2 * WITHIN) as mesh,
        subprocess.Popen(["awk", program], stdout=subprocess.PIPE, start_new_session=True) as source,
        subprocess.Popen(publish, stdin=source.stdout, stderr=subprocess.PIPE, text=True) as sensor,
    ):
        try:
            found = good(mesh.estimates("main"), 20)
        finally:
            os.killpg(source.pid, signal.SIGTERM)
            words = sensor.communicate(timeout=WITHIN)[1]
            print(words)
    assert sensor.returncode in (0, 1), words
    assert "gauge is on the mesh 'external'" in words
    assert found[-1].upper[0] - found[-1].lower[0] < 4 * R
    lines = 'nonsense\n{"time": "now", "y": 3.1}\n{"time": "2024-05-01T12:00:00", "y": 3}\n{"y": [1, 2]}\n'
    done = subprocess.run(publish, input=lines, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert "line 1: header 'nonsense': unknown column 'nonsense'" in done.stderr
    assert "line 3: time '2024-05-01T12:00:00' has no time zone" in done.stderr
    assert "line 4: gauge: found 2 value(s), expected 1: gauge" in done.stderr
    assert "1 sent, 3 line(s) not" in done.stderr


def test_one_line_of_a_short_program_comes_through(start: Start, mesh_file: Path) -> None:
    run(start, mesh_file)
    publish = [sys.executable, "-P", "-m", "lsu_mesh_services", "publish", "gauge", "-c", str(mesh_file)]
    with connect(mesh_file, wait=2 * WITHIN) as mesh:
        mesh.model()
        estimates = mesh.estimates("main")
        done = subprocess.run(publish, input="3.1\n", capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        assert good(estimates, 1)[0].raw["used"]


def test_who_is_no_external_sensor_is_told(start: Start, mesh_file: Path) -> None:
    run(start, mesh_file)
    publish = [sys.executable, "-P", "-m", "lsu_mesh_services", "publish", "gage", "-c", str(mesh_file)]
    done = subprocess.run(publish, input="3.1\n", capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "mesh 'external' has no sensor 'gage'; its sensors: gauge" in done.stderr


def test_another_mesh_at_the_entry_is_named(start: Start, mesh_file: Path) -> None:
    run(start, mesh_file)
    entry = next(line.split('"')[1] for line in mesh_file.read_text().splitlines() if line.startswith("entry"))
    with connect(mesh_file, wait=2 * WITHIN) as mesh:
        mesh.model()
        with connect(name="lab", entry=entry, wait=3.0) as other, pytest.raises(NoMesh) as silence:
            other.model()
    assert "peers of 'external' are there, but nobody answers lsu/v1/lab/model" in str(silence.value)
    assert "not 'lab'" in str(silence.value)


def test_a_mesh_with_certificates_takes_the_sensor_and_tells_who_may_not(start: Start, mesh_file: Path) -> None:
    text = mesh_file.read_text().replace("tcp/", "tls/")
    mesh_file.write_text(f"{text}[network.tls]\nenabled = true\n")
    assert start("keys", "init", str(mesh_file)).wait() == 0
    run(start, mesh_file)
    keys = mesh_file.parent / "keys"
    with connect(mesh_file, wait=2 * WITHIN) as mesh:
        gauge, estimates = mesh.sensor("gauge"), mesh.estimates("main")
        with sending(gauge):
            good(estimates, 10)
    with connect(mesh_file, wait=3.0) as mesh:
        (keys / "gauge.pem").write_bytes((keys / "main.pem").read_bytes())
        with pytest.raises(NotAllowed, match="certificate of 'main', which may publish as 'main' and nobody else"):
            mesh.sensor("gauge")
    stranger = Authority.new("external", 2, keys / "other.pem", keys / "other.key")
    for ending in ("pem", "key"):
        (keys / f"gauge.{ending}").unlink()
    stranger.issue("gauge", ("localhost", "127.0.0.1"), 2, keys / "gauge.pem", keys / "gauge.key")
    with connect(mesh_file, wait=3.0) as mesh, pytest.raises(NoMesh, match="it refuses this certificate"):
        mesh.sensor("gauge")
