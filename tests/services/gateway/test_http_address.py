"""Never open by accident, and no stranger's name for this machine."""

from __future__ import annotations

import socket

import pytest
from lsu_mesh_services.gateway.http_address import (
    HttpAddress,
    WrongHttpAddress,
    allowed_hosts,
    bind,
    bound,
    read_address,
)


@pytest.mark.parametrize("text", ["127.0.0.1:8080", "127.8.8.8:1", "[::1]:0", "localhost:80"])
def test_loopback_addresses_need_no_word(text: str) -> None:
    assert read_address(text, allow_remote=False).is_loopback


@pytest.mark.parametrize("text", ["0.0.0.0:8080", "[::]:8080", "192.168.1.7:80", "lab-7:80", "localhost.evil.com:80"])
def test_other_addresses_need_allow_remote(text: str) -> None:
    with pytest.raises(WrongHttpAddress, match=r"other hosts could read the mesh.*--allow-remote"):
        read_address(text, allow_remote=False)
    assert not read_address(text, allow_remote=True).is_loopback


@pytest.mark.parametrize("text", ["8080", ":8080", "127.0.0.1", "127.0.0.1:99999", "::1:80", "http://127.0.0.1:80"])
def test_what_is_no_address_is_said(text: str) -> None:
    with pytest.raises(WrongHttpAddress, match="expected HOST:PORT, such as"):
        read_address(text, allow_remote=True)


def test_a_taken_port_is_said_and_a_free_one_is_told() -> None:
    with bind(HttpAddress("127.0.0.1", 0)) as first:
        taken = bound(first, HttpAddress("127.0.0.1", 0))
        assert taken.port > 0
        with pytest.raises(WrongHttpAddress, match=rf"{taken.port}: cannot listen there: .*in use"):
            bind(taken)


@pytest.mark.parametrize(
    ("host", "is_allowed"),
    [
        ("127.0.0.1:8080", True), ("localhost:8080", True), ("LOCALHOST", True), ("[::1]:8080", True), ("lab", True),
        ("evil.com:8080", False), ("", False), ("localhost.evil.com", False), ("127.0.0.1.evil.com:80", False),
        ("192.168.1.7", False),
    ],
)  # fmt: skip
def test_on_loopback_only_its_names_are_answered(host: str, is_allowed: bool) -> None:
    assert allowed_hosts(HttpAddress("127.0.0.1", 8080), ["lab"]).allow(host) is is_allowed


def test_open_to_others_numbers_and_the_name_of_the_machine_are_answered() -> None:
    hosts = allowed_hosts(HttpAddress("0.0.0.0", 8080), [])
    assert hosts.allow("192.168.1.7:8080")
    assert hosts.allow("[fe80::1]:8080")
    assert hosts.allow(f"{socket.gethostname()}:8080")
    assert not hosts.allow("evil.com:8080")


def test_the_address_for_a_browser() -> None:
    assert HttpAddress("::1", 80).url == "http://[::1]:80"
    assert HttpAddress("127.0.0.1", 80).url == "http://127.0.0.1:80"
