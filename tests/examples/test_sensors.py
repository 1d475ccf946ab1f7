"""The sensors of other languages: their bytes are what the protocol says, and a mesh takes them."""

from __future__ import annotations

import http.server
import json
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import msgpack
import pytest

from lsu_mesh.mesh.messages import Measurement, read

DATA = Path(__file__).parent / "data"
CAPTURED = bytes.fromhex(
    "de000bda000176cf0000000000000001da0003737263da000a73656e736f722f677073da0004626f6f74da00103031323334353637383961"
    "6263646566da0003736571cf0000000000000007da000473746570cf0000000000000000da000773656e745f6e73cf17979cfe451ff4c0da"
    "00096f726967696e5f6e73cf17979cfe451ff4c0da00056d6f64656cda001062303135393833633534653665346432da000774696d655f6e"
    "73cf17979cfe4510b281da000d74696d655f6572726f725f6e73cf0000000000000078da000179dc0002cb3ff8000000000000c0"
)
"""What ``tests/examples/data/measurement.cpp`` wrote, compiled by g++ 12."""
ANSWER = {"v": 1, "model": "b015983c54e6e4d2", "dt": 0.1, "schedule": [{"first": 2, "model": {"A": [[1.0]]}}]}


def test_the_bytes_of_the_sensor_in_cpp_are_a_measurement() -> None:
    message, unknown = read("measurement", CAPTURED)
    assert unknown == ()
    assert message == Measurement(
        v=1, src="sensor/gps", boot="0123456789abcdef", seq=7, step=0, sent_ns=1_700_000_000_251_000_000,
        origin_ns=1_700_000_000_251_000_000, model="b015983c54e6e4d2", y=[1.5, None],
        time_ns=1_700_000_000_250_000_001, time_error_ns=120,
    )  # fmt: skip


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
def test_the_sensor_in_cpp_still_writes_those_bytes(root: Path, tmp_path: Path) -> None:
    program = tmp_path / "measurement"
    folder = root / "examples" / "cpp"
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-I", str(folder)]
    subprocess.run(["g++", *flags, str(DATA / "measurement.cpp"), "-o", str(program)], check=True)
    done = subprocess.run([str(program)], input=msgpack.packb(ANSWER), capture_output=True, check=True)
    assert done.stdout == CAPTURED


class Gateway(http.server.BaseHTTPRequestHandler):
    """Two routes of the gateway, as its page describes them."""

    posted: list[tuple[str, str, Any]]
    came: threading.Event

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        self.posted.append((self.path, self.headers["authorization"], body))
        is_good = self.headers["authorization"] == "Bearer secret"
        self._answer(202 if is_good else 401, b"{}" if is_good else b'{"error": "no", "remedy": "a token"}')
        self.came.set()

    def do_GET(self) -> None:
        event = (
            b'event: estimate\ndata: {"step": 7, "lower": [0.5], "upper": [1], "sent_ns": "1700000000250000001"}\n\n'
        )
        self._answer(200, b": a comment\n\n" + event)

    def _answer(self, status: int, body: bytes) -> None:
        self.send_response(status)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
@pytest.mark.parametrize("token", ["secret", "wrong"])
def test_javascript_sends_and_reads_over_the_gateway(root: Path, token: str) -> None:
    posted: list[tuple[str, str, Any]] = []
    handler = type("Handler", (Gateway,), {"posted": posted, "came": threading.Event()})
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        base = f"http://127.0.0.1:{server.server_port}"
        command = ["node", str(root / "examples" / "gateway.mjs"), base, "gauge", "main", token]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            line = program.stdout.readline()
            assert handler.came.wait(30)
            program.terminate()
            words = program.communicate()[1]
        server.shutdown()
    assert line == "7 [ 0.5 ] [ 1 ] 1700000000250n\n"
    path, authorization, body = posted[0]
    assert (path, authorization, body["time"]) == ("/measurements/gauge", f"Bearer {token}", "now")
    assert abs(body["y"][0]) <= 1
    assert ("401: no; a token" in words) == (token == "wrong") or len(posted) == 1


@pytest.mark.live
def test_the_sensor_in_plain_zenoh_is_taken_by_a_mesh(lsu_mesh_command: list[str], root: Path, tmp_path: Path) -> None:
    from lsu_mesh_services.client import connect
    from ports import free_port

    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), str(root / "services")])}
    file, entry = tmp_path / "mesh.toml", f"tcp/127.0.0.1:{free_port()}"
    subprocess.run([*lsu_mesh_command, "new", str(file), "--from", "external"], env=environment, check=True)
    file.write_text(f'{file.read_text()}\n[network]\nentry = "{entry}"\n')
    sensor = [sys.executable, str(root / "examples" / "sensor.py"), entry, "external", "gauge"]
    reader = [sys.executable, str(root / "examples" / "subscribe.py"), entry, "main"]
    with (
        subprocess.Popen([*lsu_mesh_command, "run", str(file), "--no-record"], env=environment) as mesh,
        subprocess.Popen(reader, stdout=subprocess.PIPE, text=True) as subscriber,
        subprocess.Popen(sensor, stdin=subprocess.PIPE, text=True) as measuring,
    ):
        try:
            assert measuring.stdin is not None
            assert subscriber.stdout is not None
            with connect(name="external", entry=entry, wait=60.0) as client:
                estimates, estimate = client.estimates("main"), None
                for _ in range(300):
                    measuring.stdin.write("3.1\n")
                    measuring.stdin.flush()
                    estimate = estimates.next(0.1)
                    if estimate is not None and estimate.status == "ok":
                        break
                assert estimate is not None
                assert estimate.lower[0] <= 3.1 <= estimate.upper[0]
                assert estimate.raw["used"][0][:2] == ["measurement", "sensor/gauge"]
            assert subscriber.stdout.readline().startswith("step ")
        finally:
            for process in (measuring, subscriber, mesh):
                process.terminate()
