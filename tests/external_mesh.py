"""Real peers started one by one, and programs of the test that measure a motion which is known at every moment."""

from __future__ import annotations

import math
import random
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import msgpack
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.supervisor import Child, Supervisor
from ports import free_port

from lsu_mesh.mesh.config.settings import SupervisorSettings

SECOND = 10**9
MESH = """
[mesh]
name = "own"
dt = 0.1
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-100.0, -10.0]
upper = [100.0, 10.0]
[model.domain]
lower = [-1000.0, -50.0]
upper = [1000.0, 50.0]
[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
r = [0.5]
[sensors.speed]
source = "external"
C = [[0.0, 1.0]]
r = [0.2]
[filters.box]
kind = "LSUPB"
sensors = ["gauge", "speed"]
[filters.cz]
kind = "LSUCZ"
sensors = ["gauge", "speed"]
[fusion.main]
sources = ["box", "cz"]
"""
HALF_WIDTHS = {"gauge": 0.5, "speed": 0.2}


def state(time_ns: int) -> tuple[float, float]:
    """Position 3 sin(t/2) and speed: its acceleration stays below .75, and rho is 2."""
    t = (time_ns % (10_000 * SECOND)) / SECOND
    return 3.0 * math.sin(0.5 * t), 1.5 * math.cos(0.5 * t)


class Program:
    """A sensor of somebody else: a thread with a session, a clock and a count of its own."""

    def __init__(self, mesh: ExternalMesh, name: str, *, offset_s: float = 0.0, pause_s: float = 0.07) -> None:
        self._mesh, self.name, self.pause_s = mesh, name, pause_s
        self.offset_ns = int(offset_s * SECOND)
        self.copies = self.holds_back = False
        """Send everything twice; send in pairs, the later one first."""
        self.sent = 0
        self._boot, self._seq = secrets.token_hex(8), 0
        self._held: bytes | None = None
        self._random = random.Random(f"{name}/{self._boot}")
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """As a program that is killed: without a word."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        key = f"lsu/v1/own/measurement/{self.name}"
        with Bus(SessionSettings(connect=(self._mesh.entry,)), Clock()) as bus:
            bus.announce(key)
            asked, digest = 0.0, ""
            while not self._ending.wait(self.pause_s * self._random.uniform(0.5, 1.5)):
                if time.monotonic() > asked + 0.5:
                    asked = time.monotonic()
                    bus.ask_all("lsu/v1/own/model")
                while (arrival := bus.next(0)) is not None:
                    digest = msgpack.unpackb(arrival.payload)["model"]
                if digest:
                    self._send(bus, key, digest)

    def _send(self, bus: Bus, key: str, digest: str) -> None:
        now = time.time_ns()
        r = HALF_WIDTHS[self.name]
        y = state(now)[0 if self.name == "gauge" else 1] + self._random.uniform(-r, r) * 0.999
        stamp = now + self.offset_ns
        message = {
            "v": 1, "src": f"sensor/{self.name}", "boot": self._boot, "seq": self._seq, "sent_ns": stamp,
            "origin_ns": stamp, "model": digest, "y": [y], "time_ns": stamp, "time_error_ns": 0,
        }  # fmt: skip
        self._seq += 1
        self.sent += 1
        payload = msgpack.packb(message)
        if self.holds_back and self._held is None:
            self._held = payload
            return
        held, self._held = self._held, None
        for one in (payload, held):
            for _ in range(2 if self.copies else 1):
                if one is not None:
                    bus.publish(key, one, "application/msgpack;lsu.measurement/1")


class ExternalMesh:
    """Peers by hand around one entry that the test holds; every estimate is compared with the motion as it comes."""

    def __init__(self, folder: Path, text: str = MESH) -> None:
        self.file = folder / "mesh.toml"
        self.file.write_text(text)
        self.entry = f"tcp/127.0.0.1:{free_port()}"
        self.supervisor = Supervisor(SupervisorSettings(restart=True, backoff=0.0, limit=10**6))
        self.starts: dict[str, int] = {}
        """By digest, the start that a ``model`` answer has told."""
        self.sets: Counter[str] = Counter()
        self.last_at: dict[str, float] = {}
        self.last: dict[str, dict] = {}  # type: ignore[type-arg]
        self.outside: list[str] = []
        self.health: dict[str, dict] = {}  # type: ignore[type-arg]
        self.events: list[dict] = []  # type: ignore[type-arg]
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self.programs: list[Program] = []

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        for program in self.programs:
            program.stop()
        self.supervisor.kill()
        for child in self.supervisor.children:
            if child.reader is not None:
                child.reader.join(timeout=10)
        self._ending.set()
        self._thread.join()

    def start(self, role: str, name: str) -> Child:
        """A peer as a process, as by hand."""
        arguments = ["-c", str(self.file), "-X", f"network.entry={self.entry}", "-e", self.entry]
        return self.supervisor.start(role, name, arguments)

    def program(self, name: str, **options: float) -> Program:
        """A sensor."""
        program = Program(self, name, **options)
        self.programs.append(program)
        return program

    def end(self, program: Program) -> None:
        """Kill a sensor."""
        program.stop()
        self.programs.remove(program)

    def until(self, met: Callable[[], bool], what: str, timeout: float = 60.0) -> float:
        """Wait; returns for how long."""
        began = time.monotonic()
        while not met():
            self.supervisor.watch(time.monotonic())
            if time.monotonic() - began > timeout:
                words = "\n".join(f"{child.label}:\n{child.last_words()}" for child in self.supervisor.children)
                said = {name: (one["level"], one["reasons"]) for name, one in self.health.items()}
                raise AssertionError(f"{what}: not within {timeout:g} s\n{said}\n{words}")
            time.sleep(0.02)
        return time.monotonic() - began

    def flows(self, name: str) -> bool:
        """Whether an estimator has published in the last half second."""
        return time.monotonic() - self.last_at.get(name, -10.0) < 0.5

    def complains(self, name: str, *words: str) -> bool:
        """Whether the health of a peer names all this."""
        reasons = " ".join(self.health.get(name, {}).get("reasons", []))
        return all(word in reasons for word in words)

    def _watch(self) -> None:
        with Bus(SessionSettings(listen=(self.entry,)), Clock()) as bus:
            for topic in ("posterior", "fused", "health", "event"):
                bus.subscribe_live(f"lsu/v1/own/{topic}/*")
            asked = 0.0
            while not self._ending.is_set():
                if time.monotonic() > asked + 0.3:
                    asked = time.monotonic()
                    bus.ask_all("lsu/v1/own/model")
                arrival = bus.next(0.1)
                if arrival is not None and arrival.what == "sample":
                    self._take(arrival.key, msgpack.unpackb(arrival.payload))

    def _take(self, key: str, message: dict) -> None:  # type: ignore[type-arg]
        if key.endswith("/model"):
            self.starts[message["model"]] = message["start_ns"]
            return
        name = message["src"].partition("/")[2]
        if "/health/" in key:
            self.health[name] = message
        elif "/event/" in key:
            self.events.append(message)
        else:
            self.last_at[name], self.last[name] = time.monotonic(), message
            self._compare(name, message)

    def _compare(self, name: str, message: dict) -> None:  # type: ignore[type-arg]
        start = self.starts.get(message["model"])
        if start is None:
            return
        x = state(start + message["step"] * SECOND // 10)
        self.sets[name] += 1
        if not all(
            low <= value <= high for low, value, high in zip(message["lower"], x, message["upper"], strict=True)
        ):
            self.outside.append(f"{message['src']} step {message['step']}: {x} {message['lower']} {message['upper']}")
        if message["status"] == "inconsistent":
            self.outside.append(f"{message['src']} step {message['step']}: {message}")
