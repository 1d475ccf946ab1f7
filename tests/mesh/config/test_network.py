"""``[network]`` and ``[network.tls]``: mistakes and doubts."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.config.network import is_open_to_others

TLS = "network.tls.enabled=true"


def problems(demo: Path, *overrides: str) -> tuple[str, ...]:
    with pytest.raises(ConfigurationError) as caught:
        load(demo, overrides)
    return caught.value.problems


def test_plain_loopback_is_the_default(demo: Path) -> None:
    network = load(demo).network
    assert network.entry == "tcp/127.0.0.1:7447"
    assert not network.tls.enabled


def test_with_tls_the_default_entry_is_encrypted_and_access_is_controlled(demo: Path) -> None:
    network = load(demo, [TLS]).network
    assert network.entry == "tls/127.0.0.1:7447"
    assert network.tls.access_control
    assert network.tls.verify_hosts


def test_with_tls_a_plain_endpoint_is_a_mistake_that_says_the_encrypted_one(demo: Path) -> None:
    (problem,) = problems(demo, TLS, "network.entry=tcp/127.0.0.1:9000")
    assert "[network] entry" in problem
    assert 'expected "tls/127.0.0.1:9000"' in problem


def test_a_key_in_the_configuration_is_a_mistake_that_does_not_repeat_it(demo: Path) -> None:
    (problem,) = problems(demo, 'network.tls.key="-----BEGIN PRIVATE KEY-----abc"')
    assert "holds no secret" in problem
    assert "abc" not in problem


def test_a_name_that_certificates_use_is_a_mistake_with_tls_only(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace("[filters.box]", "[filters.viewer]").replace('"box"', '"viewer"'))
    load(file)
    (problem,) = problems(file, TLS)
    assert '"viewer"' in problem


def test_an_unknown_option_is_told_with_the_nearest(demo: Path) -> None:
    (problem,) = problems(demo, "network.tls.acess_control=true")
    assert 'did you mean "access_control"?' in problem


@pytest.mark.parametrize(
    ("endpoint", "is_open"),
    [
        ("tcp/127.0.0.1:7447", False), ("tcp/127.3.2.1:0", False), ("tcp/localhost:7447", False),
        ("tcp/[::1]:7447", False), ("tcp/0.0.0.0:7447", True), ("tcp/[::]:7447", True), ("udp/10.0.0.1:1", True),
        ("tcp/127.0.0.1.example.org:7447", True), ("tcp/localhost.example.org:7447", True), ("tls/0.0.0.0:7447", False),
        ("tcp/0.0.0.0:7447#iface=lo", True), ("unixsock-stream/tmp/a:b", False),
    ],
)  # fmt: skip
def test_what_other_hosts_can_reach_without_a_certificate(endpoint: str, is_open: bool) -> None:
    assert is_open_to_others(endpoint) == is_open


def test_an_open_door_in_the_file_is_a_warning(demo: Path) -> None:
    assert load(demo).warnings == ()
    (warning,) = load(demo, ['network.listen=["tcp/0.0.0.0:7447"]']).warnings
    assert "--insecure" in str(warning)
    assert load(demo, [TLS, 'network.listen=["tls/0.0.0.0:7447"]']).warnings == ()
    assert load(demo, ["network.entry=tcp/lab-7:7447"]).warnings == (), "most peers only connect to it"
