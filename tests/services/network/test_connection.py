"""What a process says of its connection: nobody, where it tries and why that does not answer; then to how many."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Sequence

import pytest
from lsu_mesh_services.network.connection import (
    NO_SESSION,
    REFUSED,
    UNKNOWN_NAME,
    ConnectionReport,
    ConnectionWords,
    why_silent,
)
from ports import free_port

ENTRY = "tcp/127.0.0.1:7447"


def said(words: ConnectionWords, looks: Sequence[tuple[float, int, dict[str, str] | None]]) -> list[tuple[float, str]]:
    """Time and text of everything that is said."""
    told = [(now, words.say(links, reasons, now)) for now, links, reasons in looks]
    return [(now, text) for now, text in told if text is not None]


def looks(
    begin: float, end: float, links: int, reasons: dict[str, str] | None
) -> list[tuple[float, int, dict[str, str] | None]]:
    return [(begin + 0.1 * k, links, reasons) for k in range(round((end - begin) * 10))]


def test_connected_to_nobody_is_said_within_a_second_once_with_its_reason() -> None:
    words = ConnectionWords([ENTRY], ["tcp/127.0.0.1:0"])
    told = said(words, [*looks(0, 0.2, 0, None), *looks(0.2, 5, 0, {ENTRY: REFUSED})])
    assert [text for _, text in told] == [f"connected to nobody, trying {ENTRY}; connection refused"]
    assert told[0][0] < 1.0


def test_a_reason_that_is_long_in_coming_is_added_later_and_a_new_one_is_said() -> None:
    words = ConnectionWords(["tcp/nowhere:1"], [])
    why = {"tcp/nowhere:1": UNKNOWN_NAME}
    told = said(words, [*looks(0, 3, 0, None), *looks(3, 4, 0, why), *looks(4, 5, 0, {"tcp/nowhere:1": REFUSED})])
    assert [text for _, text in told] == [
        "connected to nobody, trying tcp/nowhere:1",
        "connected to nobody, trying tcp/nowhere:1; name not known",
        "connected to nobody, trying tcp/nowhere:1; connection refused",
    ]
    assert told[0][0] < 1.0


def test_to_how_many_it_is_connected_is_said_when_that_has_settled_and_the_loss_of_all() -> None:
    words = ConnectionWords([ENTRY], [])
    grows = [(0.1 * k, min(k, 5), None) for k in range(20)]
    told = said(words, [*grows, *looks(2, 4, 6, None), *looks(4, 6, 0, {ENTRY: REFUSED}), *looks(6, 8, 1, None)])
    assert [text for _, text in told] == [
        "on the mesh: connected to 5 peers",
        f"connected to nobody, trying {ENTRY}; connection refused",
        "on the mesh: connected to 1 peer",
    ]


def test_a_tool_says_nothing_as_long_as_it_is_connected() -> None:
    words = ConnectionWords([ENTRY], [], says_connected=False)
    assert said(words, looks(0, 3, 2, None)) == []
    told = said(words, [*looks(3, 5, 0, {ENTRY: REFUSED}), *looks(5, 7, 2, None)])
    assert [text for _, text in told][1:] == ["on the mesh: connected to 2 peers"]


def test_several_addresses_have_each_its_reason_and_a_listener_says_where_it_listens() -> None:
    several = ConnectionWords(["tcp/a:1", "udp/b:2"], [])
    ((_, text),) = said(several, looks(0, 2, 0, {"tcp/a:1": UNKNOWN_NAME, "udp/b:2": ""}))
    assert text == "connected to nobody, trying tcp/a:1 (name not known), udp/b:2"
    listener = ConnectionWords([], ["tcp/127.0.0.1:9"])
    ((_, text),) = said(listener, looks(0, 2, 0, None))
    assert text == "connected to nobody, listening on tcp/127.0.0.1:9"


def test_a_look_from_outside_tells_why_an_address_is_silent() -> None:
    assert why_silent(f"tcp/127.0.0.1:{free_port()}") == REFUSED
    assert why_silent("tcp/no-such-host.invalid:7447") == UNKNOWN_NAME
    assert why_silent("udp/no-such-host.invalid:7447") == UNKNOWN_NAME
    assert why_silent("unixsock-stream/tmp/socket") == ""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert why_silent(f"tcp/127.0.0.1:{port}") == NO_SESSION
        assert why_silent(f"tls/127.0.0.1:{port}?x=1") == NO_SESSION


def test_a_name_that_takes_long_to_look_up_holds_nobody_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    released = threading.Event()

    def slow(*_: object, **__: object) -> None:
        released.wait(20)
        raise socket.gaierror

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    links = [0]
    words = ConnectionWords(["tcp/slow:1"], [])
    began = time.monotonic()
    with ConnectionReport("filter a", lambda: links[0], words):
        time.sleep(1.3)
        links[0] = 3
        time.sleep(0.8)
    assert time.monotonic() - began < 5.0
    released.set()
    assert capsys.readouterr().err.splitlines() == [
        "filter a: connected to nobody, trying tcp/slow:1",
        "filter a: on the mesh: connected to 3 peers",
    ]
