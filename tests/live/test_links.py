"""A connection between two peers breaks while both live on: gossip does not open it again, the session does."""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence

import psutil
import pytest
from ports import free_port

from services.bus import Bus, Clock, SessionSettings

pytestmark = pytest.mark.live

PEERS = 4
"""One that holds the entry, and those that find one another through it."""


def until(met: Callable[[], bool], what: str, timeout: float = 30.0) -> None:
    end = time.monotonic() + timeout
    while not met():
        assert time.monotonic() < end, what
        time.sleep(0.02)


@pytest.fixture
def entry() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def peers(entry: str) -> Iterator[Sequence[Bus]]:
    clock = Clock()
    with contextlib.ExitStack() as stack:
        buses = [stack.enter_context(Bus(SessionSettings((), (entry,)), clock))]
        buses += [stack.enter_context(Bus(SessionSettings((entry,)), clock)) for _ in range(PEERS - 1)]
        for i, bus in enumerate(buses):
            bus.declare_alive(f"test/live/{i}")
            bus.watch_alive("test/live/*")
        until(lambda: are_whole(buses), "everybody is linked to everybody")
        yield buses


def are_whole(buses: Sequence[Bus]) -> bool:
    return [bus.links() for bus in buses] == [PEERS - 1] * PEERS


def shut_down_a_link(entry: str) -> None:
    """One connection of this process that is not one with the entry; both ends are told."""
    port = int(entry.rpartition(":")[2])
    between = [
        connection
        for connection in psutil.Process().net_connections("tcp")
        if connection.status == psutil.CONN_ESTABLISHED and port not in (connection.laddr.port, connection.raddr.port)
    ]
    with socket.socket(fileno=os.dup(between[0].fd)) as one:
        one.shutdown(socket.SHUT_RDWR)


def test_two_peers_whose_connection_broke_find_each_other_again(peers: Sequence[Bus], entry: str) -> None:
    for _ in range(2):
        shut_down_a_link(entry)
        until(lambda: not are_whole(peers), "the link is gone")
        until(lambda: are_whole(peers), "the link is back, and no session too many")


def test_what_was_published_meanwhile_arrives(peers: Sequence[Bus], entry: str) -> None:
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
    shut_down_a_link(entry)
    until(lambda: not are_whole(peers), "the link is gone")
    end = time.monotonic() + 30
    while not are_whole(peers):
        assert time.monotonic() < end
        publish()
    for _ in range(25):
        publish()
    time.sleep(1)
    for i, bus in enumerate(peers):
        seen: dict[str, set[int]] = {}
        while (arrival := bus.next(0.5)) is not None:
            if arrival.what == "sample" and arrival.key != f"test/data/{i}":
                seen.setdefault(arrival.key, set()).add(int(arrival.payload))
        others = {f"test/data/{j}" for j in range(PEERS) if j != i}
        assert {key: sorted(numbers) for key, numbers in seen.items()} == {key: list(range(sent)) for key in others}
