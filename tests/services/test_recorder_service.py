"""The recorder's loop says of whom it hears nothing; it alone can know that nothing of a peer is recorded."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.mesh_start import MeshStart
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue
from lsu_mesh_services.recorder import RecorderService

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Health, decode, encode

SECOND = 1_000_000_000


class Line:
    """A bus that hands over what a test put in, and keeps what is published."""

    dropped = 0

    def __init__(self) -> None:
        self.came: list[Arrival] = []
        self.arrivals = ReceiveQueue()
        self.published: list[Health] = []

    def next(self, timeout: float) -> Arrival | None:
        return self.came.pop(0) if self.came else None

    def waiting(self) -> int:
        return len(self.came)

    def links(self) -> int:
        return 1

    def recover(self, *_: object) -> None:
        self.copies = 0

    def ask_cache(self, address: str, span: object) -> None:
        raise AssertionError(f"nothing is missing, but {address} was asked for")

    def publish(self, address: str, payload: bytes, encoding: str) -> None:
        message = decode("health", payload)
        assert isinstance(message, Health)
        self.published.append(message)


class Disk:
    """A recorder that writes nothing."""

    problems: tuple[str, ...] = ()
    flushed: dict[str, int] = {}  # noqa: RUF012

    def __init__(self) -> None:
        self.recorded: list[str] = []

    def record(self, address: str, payload: bytes, arrival_ns: int, message: object) -> None:
        self.recorded.append(address)

    def tick(self, now: int) -> None:
        pass


class Watch:
    """The time, as the test says."""

    def __init__(self) -> None:
        self.time = 100 * SECOND

    def now(self) -> int:
        return self.time


@pytest.fixture
def configuration(demo: Path) -> Configuration:
    return load(demo)


def test_a_peer_of_which_nothing_is_heard_is_named_and_forgiven(configuration: Configuration) -> None:
    line, disk, watch = Line(), Disk(), Watch()
    parts: Any = (disk, line, watch)
    service = RecorderService(configuration, *parts, start=MeshStart(configuration, "recorder", "recorder"))
    others = [(role, name) for role, name in configuration.peers() if role != "recorder"]
    counts = dict.fromkeys((name for _, name in others), 0)

    def pass_second(silent: str = "") -> Health:
        watch.time += SECOND
        for role, name in others:
            if name != silent:
                health = Health(
                    v=1, src=f"{role}/{name}", boot="0" * 16, seq=counts[name], step=0, sent_ns=watch.time,
                    origin_ns=watch.time, model=configuration.digest(), role=role, level="OK", reasons=[], counters={},
                )  # fmt: skip
                counts[name] += 1
                line.came.append(Arrival("sample", key("demo", "health", name), encode(health), watch.time))
        service.turn()
        return line.published[-1]

    assert [pass_second().level for _ in range(5)] == ["OK"] * 5
    told = [pass_second("main") for _ in range(6)]
    assert told[0].level == told[1].level == "OK"
    assert told[-1].level == "WARN"
    assert told[-1].reasons == ["nothing from lsu/v1/demo/health/main for 6 s"]
    assert pass_second().level == "OK"
    assert len(disk.recorded) == 12 * len(others) - 6


def test_it_tells_when_and_where_it_was_started(configuration: Configuration) -> None:
    line, watch = Line(), Watch()
    parts: Any = (Disk(), line, watch)
    began = watch.time
    service = RecorderService(configuration, *parts, start=MeshStart(configuration, "recorder", "recorder"))
    watch.time += 5 * SECOND
    service.turn()
    assert (line.published[-1].started_ns, line.published[-1].host) == (began, socket.gethostname())
