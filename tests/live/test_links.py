"""A connection between two peers breaks while both live on: gossip does not open it again, the session does."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import psutil
import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.commands.keys import make_files
from lsu_mesh_services.network.certificate_authority import LOOPBACK_HOSTS
from lsu_mesh_services.network.security import Certificates, certificates
from ports import free_port
from waiting import WITHIN, until

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import READER, key

pytestmark = pytest.mark.live

NAMES = ("main", "plant", "s1", "box")
"""Peers that find one another through the one that holds the entry."""


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def peers(port: int) -> Iterator[Sequence[Bus]]:
    with joined(f"tcp/127.0.0.1:{port}", "tcp/127.0.0.1:0", lambda name: None) as buses:
        yield buses


@pytest.fixture
def secured_peers(port: int, demo: Path, tmp_path: Path) -> Iterator[Sequence[Bus]]:
    """With a certificate each, and access control: here an entry may not tell who is there."""
    entry = f"tls/127.0.0.1:{port}"
    file = Path(shutil.copy(demo, tmp_path / "mesh.toml"))
    configuration = load(file, ("network.tls.enabled=true", f"network.entry={entry}"))
    make_files(configuration, LOOPBACK_HOSTS, days=2)
    with joined(entry, "tls/127.0.0.1:0", lambda name: certificates(configuration, name)) as buses:
        yield buses


@contextlib.contextmanager
def joined(entry: str, listen: str, shows: Callable[[str], Certificates | None]) -> Iterator[Sequence[Bus]]:
    clock = Clock()
    with contextlib.ExitStack() as stack:
        buses = [stack.enter_context(Bus(SessionSettings((), (entry,), certificates=shows(READER)), clock))]
        for name in NAMES:
            buses.append(
                stack.enter_context(Bus(SessionSettings((entry,), (listen,), certificates=shows(name)), clock))
            )
            buses[-1].declare_alive(key("demo", "live", name))
        for bus in buses:
            bus.watch_alive(key("demo", "live", "*"))
        until(lambda: are_whole(buses), "everybody is linked to everybody")
        yield buses


def are_whole(buses: Sequence[Bus]) -> bool:
    return [bus.links() for bus in buses] == [len(NAMES)] * (len(NAMES) + 1)


def shut_down_a_link(port: int) -> None:
    """One connection of this process that is not one with the entry; both ends are told."""
    between = [
        connection
        for connection in psutil.Process().net_connections("tcp")
        if connection.status == psutil.CONN_ESTABLISHED and port not in (connection.laddr.port, connection.raddr.port)
    ]
    with socket.socket(fileno=os.dup(between[0].fd)) as one:
        one.shutdown(socket.SHUT_RDWR)


@pytest.mark.parametrize("fixture", ["peers", "secured_peers"])
def test_two_peers_whose_connection_broke_find_each_other_again(
    fixture: str, port: int, request: pytest.FixtureRequest
) -> None:
    peers: Sequence[Bus] = request.getfixturevalue(fixture)
    for _ in range(2):
        shut_down_a_link(port)
        until(lambda: not are_whole(peers), "the link is gone")
        until(lambda: are_whole(peers), "the link is back, and no session too many")


def test_what_was_published_meanwhile_arrives(peers: Sequence[Bus], port: int) -> None:
    for bus in peers:
        bus.subscribe("test/data/*")
    until(lambda: are_whole(peers), "all is well")
    sent = 0

    def publish() -> None:
        nonlocal sent
        for i, bus in enumerate(peers):
            bus.publish(f"test/data/{i}", str(sent).encode(), "text/plain")
        sent += 1
        time.sleep(0.02)

    for _ in range(25):
        publish()
    shut_down_a_link(port)
    until(lambda: not are_whole(peers), "the link is gone")
    end = time.monotonic() + WITHIN
    while not are_whole(peers):
        assert time.monotonic() < end, "the link is back"
        publish()
    for _ in range(25):
        publish()
    time.sleep(1)
    for i, bus in enumerate(peers):
        seen: dict[str, set[int]] = {}
        while (arrival := bus.next(0.5)) is not None:
            if arrival.what == "sample" and arrival.key != f"test/data/{i}":
                seen.setdefault(arrival.key, set()).add(int(arrival.payload))
        others = {f"test/data/{j}" for j in range(len(peers)) if j != i}
        assert {key: sorted(numbers) for key, numbers in seen.items()} == {key: list(range(sent)) for key in others}
