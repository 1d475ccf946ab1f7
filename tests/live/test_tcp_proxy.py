"""The proxy does to a connection what it says."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator

import pytest
from tcp_proxy import Proxy

LATER = 0.3


@pytest.fixture
def proxy() -> Iterator[Proxy]:
    """A proxy before a server that sends back what it gets."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=_echo, args=(server,), daemon=True).start()
        with Proxy(server.getsockname()[1]) as proxy:
            yield proxy
        server.shutdown(socket.SHUT_RDWR)


def _echo(server: socket.socket) -> None:
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            return
        threading.Thread(target=_echo_one, args=(connection,), daemon=True).start()


def _echo_one(connection: socket.socket) -> None:
    with connection:
        try:
            while data := connection.recv(4096):
                connection.sendall(data)
        except OSError:
            return


def connect(proxy: Proxy) -> socket.socket:
    return socket.create_connection(("127.0.0.1", proxy.port), timeout=20)


def say(connection: socket.socket, words: bytes) -> bytes:
    connection.sendall(words)
    heard = b""
    while len(heard) < len(words) and (part := connection.recv(4096)):
        heard += part
    return heard


def test_it_forwards_both_ways(proxy: Proxy) -> None:
    with connect(proxy) as one, connect(proxy) as other:
        assert say(one, b"hello") == b"hello"
        assert say(other, b"there") == b"there"


def test_a_delay_is_felt_in_both_directions_and_ends(proxy: Proxy) -> None:
    with connect(proxy) as connection:
        proxy.delay(LATER)
        began = time.monotonic()
        assert say(connection, b"slow") == b"slow"
        assert time.monotonic() - began >= 2 * LATER
        proxy.heal()
        began = time.monotonic()
        say(connection, b"fast")
        assert time.monotonic() - began < 2 * LATER


def test_a_stalled_link_carries_nothing_until_it_heals_and_loses_nothing(proxy: Proxy) -> None:
    with connect(proxy) as connection:
        assert say(connection, b"before") == b"before"
        proxy.stall()
        connection.sendall(b"during")
        connection.settimeout(LATER)
        with pytest.raises(TimeoutError):
            connection.recv(16)
        connection.settimeout(20)
        proxy.heal()
        assert connection.recv(16) == b"during"


def is_closed(connection: socket.socket) -> bool:
    try:
        connection.sendall(b"anyone?")
        return connection.recv(16) == b""
    except ConnectionError:
        return True


def test_a_cut_closes_and_refuses_until_it_heals(proxy: Proxy) -> None:
    with connect(proxy) as connection:
        assert say(connection, b"before") == b"before"
        proxy.cut()
        assert is_closed(connection)
    with connect(proxy) as connection:
        assert is_closed(connection)
    proxy.heal()
    with connect(proxy) as connection:
        assert say(connection, b"after") == b"after"


def test_corruption_flips_as_many_bits_as_it_was_told(proxy: Proxy) -> None:
    with connect(proxy) as connection:
        proxy.corrupt(1)
        heard = say(connection, b"0123456789")
        differing = [a ^ b for a, b in zip(heard, b"0123456789", strict=True)]
        assert sum(bit.bit_count() for bit in differing) == 1
        assert proxy.flipped == 1
        assert say(connection, b"clean") == b"clean"


def test_nothing_is_left_when_it_ends() -> None:
    before = threading.active_count()
    with socket.create_server(("127.0.0.1", 0)) as server:
        with Proxy(server.getsockname()[1]) as proxy, connect(proxy):
            proxy.stall()
        with pytest.raises(OSError, match="refused"):
            connect(proxy)
    assert threading.active_count() == before
