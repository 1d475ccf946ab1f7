"""``[network]`` and ``[network.tls]``: where a mesh is found, and who may reach it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from lsu_mesh.mesh.config.expected import shown
from lsu_mesh.mesh.config.problem import Problem, Problems
from lsu_mesh.mesh.config.ros2 import read_ros2_network
from lsu_mesh.mesh.config.settings import NetworkSettings, TlsSettings
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.mesh.keys import RESERVED

PROTOCOLS = ("tcp", "tls", "udp", "quic", "unixsock-stream")
EXAMPLE = '"tcp/127.0.0.1:7447"'
ENCRYPTED = ("tls", "quic")
SECRET = "-----BEGIN"
"""How certificates and keys begin, which are no part of a configuration."""
ANYWHERE = re.compile(r"/(0\.0\.0\.0|\[::\]):")
LOOPBACK = re.compile(r"127(\.\d+){3}|localhost|\[::1\]")


def protocol_of(endpoint: str) -> str:
    """``tls`` of ``tls/127.0.0.1:7447``."""
    return endpoint.partition("/")[0]


def is_open_to_others(endpoint: str) -> bool:
    """Whether another host can reach the endpoint without a certificate."""
    host = endpoint.partition("/")[2].partition("?")[0].partition("#")[0].rpartition(":")[0]
    return protocol_of(endpoint) not in (*ENCRYPTED, "unixsock-stream") and LOOPBACK.fullmatch(host) is None


def read_network(root: Table) -> NetworkSettings:
    """The table and all its mistakes."""
    table = root.table("network") or Table({}, "network", root.problems)
    tls = _read_tls(table)
    default = "tls/127.0.0.1:7447" if tls.enabled else NetworkSettings.entry
    entry = table.text("entry", default)
    listen, connect = tuple(table.texts("listen", [])), tuple(table.texts("connect", []))
    for key, endpoints in (("entry", (entry,)), ("listen", listen), ("connect", connect)):
        _check_endpoints(table, key, endpoints, tls.enabled)
    cache = table.whole("cache", None, low=1, high=10**6)
    ros2 = read_ros2_network(table)
    given = table.values.get("ros2")
    if isinstance(given, dict):
        for key, endpoints in (("connect", ros2.connect), ("listen", ros2.listen)):
            _check_endpoints(Table(given, "network.ros2", root.problems), key, endpoints, encrypted=False)
    table.finish()
    return NetworkSettings(entry=entry, listen=listen, connect=connect, cache=cache, tls=tls, ros2=ros2)


def _check_endpoints(table: Table, key: str, endpoints: Iterable[str], encrypted: bool) -> None:
    for endpoint in endpoints:
        if protocol_of(endpoint) not in PROTOCOLS or "/" not in endpoint or ":" not in endpoint:
            text = f"{shown(endpoint)} is no endpoint; expected one such as {EXAMPLE}"
            table.wrong(key, text, f"an endpoint such as {EXAMPLE}")
        elif encrypted and protocol_of(endpoint) not in ENCRYPTED:
            encrypted_one = shown(f"tls/{endpoint.partition('/')[2]}")
            text = f"{shown(endpoint)} is not encrypted, and network.tls is enabled; expected {encrypted_one}"
            table.wrong(key, text, encrypted_one)


def _read_tls(network: Table) -> TlsSettings:
    table = network.table("tls") or Table({}, "network.tls", network.problems)
    enabled = table.flag("enabled", TlsSettings.enabled)
    authority = table.text("authority", TlsSettings.authority)
    certificate = table.text("certificate", TlsSettings.certificate)
    key = table.text("key", TlsSettings.key)
    for option, text in (("authority", authority), ("certificate", certificate), ("key", key)):
        if SECRET in text:
            table.values[option] = "…"
            text = "holds a certificate or key itself; a configuration holds no secret: name its file"
            table.wrong(option, text, "the name of a file")
    access_control = table.flag("access_control", TlsSettings.access_control)
    verify_hosts = table.flag("verify_hosts", TlsSettings.verify_hosts)
    table.finish()
    return TlsSettings(
        enabled=enabled,
        authority=authority,
        certificate=certificate,
        key=key,
        access_control=access_control,
        verify_hosts=verify_hosts,
    )


def check_reserved(network: NetworkSettings, names: Sequence[tuple[str, str]], problems: Problems) -> None:
    """Names that certificates reserve; ``names`` are pairs of table and name."""
    for table, name in names:
        if network.tls.enabled and name in RESERVED:
            text = f'no peer can be called "{name}" with network.tls: certificates use that name; choose another'
            problems.add(table, "", text, expected=f"a name other than {', '.join(RESERVED)}", found=shown(name))


def open_endpoint_warnings(file: str, network: NetworkSettings) -> list[Problem]:
    """Endpoints of the file that need ``--insecure``."""
    text = (
        "can be reached from other hosts without TLS: listening there is refused without --insecure; enable network.tls"
    )
    return [
        Problem(
            file=file,
            table="network",
            key=key,
            text=f"{endpoint} {text}",
            expected="an endpoint with TLS, or of this host only",
            found=shown(endpoint),
            is_warning=True,
        )
        for key, endpoints in (("entry", (network.entry,)), ("listen", network.listen))
        for endpoint in endpoints
        if is_open_to_others(endpoint) and (key == "listen" or ANYWHERE.search(endpoint))
    ]
