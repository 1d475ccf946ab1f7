"""``[network]`` and ``[network.tls]``: where a mesh is found, and who may reach it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from lsu_mesh.mesh.config.settings import NetworkSettings, TlsSettings
from lsu_mesh.mesh.config.table import Problems, Table
from lsu_mesh.mesh.keys import RESERVED

PROTOCOLS = ("tcp", "tls", "udp", "quic", "unixsock-stream")
ENCRYPTED = ("tls", "quic")
ANYWHERE = re.compile(r"/(0\.0\.0\.0|\[::\]):")
LOOPBACK = re.compile(r"127(\.\d+){3}|localhost|\[::1\]")


def protocol_of(endpoint: str) -> str:
    """``tls`` of ``tls/127.0.0.1:7447``."""
    return endpoint.partition("/")[0]


def is_open_to_others(endpoint: str) -> bool:
    """Whether another host can reach the endpoint and nothing asks it who it is."""
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
    table.finish()
    return NetworkSettings(entry, listen, connect, cache, tls)


def _check_endpoints(table: Table, key: str, endpoints: Iterable[str], encrypted: bool) -> None:
    for endpoint in endpoints:
        if protocol_of(endpoint) not in PROTOCOLS or "/" not in endpoint or ":" not in endpoint:
            table.wrong(key, f'"{endpoint}" is no endpoint; expected one such as "tcp/127.0.0.1:7447"')
        elif encrypted and protocol_of(endpoint) not in ENCRYPTED:
            address = endpoint.partition("/")[2]
            table.wrong(key, f'"{endpoint}" is not encrypted, and network.tls is enabled; expected "tls/{address}"')


def _read_tls(network: Table) -> TlsSettings:
    table = network.table("tls") or Table({}, "network.tls", network.problems)
    enabled = table.flag("enabled", TlsSettings.enabled)
    authority = table.text("authority", TlsSettings.authority)
    certificate = table.text("certificate", TlsSettings.certificate)
    key = table.text("key", TlsSettings.key)
    for option, text in (("authority", authority), ("certificate", certificate), ("key", key)):
        if "-----BEGIN" in text:
            table.values[option] = "…"
            table.wrong(option, "holds a certificate or key itself; a configuration holds no secret: name its file")
    access_control = table.flag("access_control", TlsSettings.access_control)
    verify_hosts = table.flag("verify_hosts", TlsSettings.verify_hosts)
    table.finish()
    return TlsSettings(enabled, authority, certificate, key, access_control, verify_hosts)


def check_reserved(network: NetworkSettings, names: Sequence[str], problems: Problems) -> None:
    """Where certificates carry names, some are taken."""
    for name in sorted(set(names) & set(RESERVED)) if network.tls.enabled else ():
        problems.add("", f'no peer can be called "{name}" with network.tls: certificates use that name; choose another')


def open_endpoint_warnings(network: NetworkSettings) -> list[str]:
    """Endpoints of the file that a peer listens on only when it is told that this is meant."""
    return [
        f"[network] {key}: {endpoint} can be reached from other hosts without TLS: listening there is refused "
        "without --insecure; enable network.tls"
        for key, endpoints in (("entry", (network.entry,)), ("listen", network.listen))
        for endpoint in endpoints
        if is_open_to_others(endpoint) and (key == "listen" or ANYWHERE.search(endpoint))
    ]
