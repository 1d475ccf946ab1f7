"""How a session reaches the mesh, as settings of Zenoh; and what an error at its opening means."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lsu_mesh_services.network.security import Certificates


@dataclass(frozen=True)
class SessionSettings:
    """How to reach the mesh; ``zenoh`` holds further ``path=value`` settings of Zenoh itself."""

    connect: Sequence[str] = ()
    listen: Sequence[str] = ("tcp/127.0.0.1:0",)
    mode: str = "peer"
    cache: int = 256
    multicast: bool = False
    zenoh: Sequence[str] = ()
    certificates: Certificates | None = None


def session_values(settings: SessionSettings, lease_ms: int) -> Iterator[tuple[str, str]]:
    """Paths of Zenoh's configuration, and JSON for each; a link without a sign of life ends after the lease."""
    retry = {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2}
    values: dict[str, object] = {
        "mode": settings.mode,
        "scouting/multicast/enabled": settings.multicast,
        "scouting/gossip/enabled": True,
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}},
        "connect/endpoints": list(settings.connect),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": retry,
        "listen/endpoints": list(settings.listen),
        "transport/link/tx/lease": lease_ms,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 500_000,
        "transport/shared_memory/enabled": False,
        "timestamping/enabled": True,
        "adminspace/enabled": True,
    }
    values |= {} if settings.certificates is None else _security(settings.certificates)
    yield from ((path, json.dumps(value)) for path, value in values.items())
    for item in settings.zenoh:
        path, _, text = item.partition(":" if ":" in item.partition("=")[0] else "=")
        yield path, text


def _security(files: Certificates) -> dict[str, object]:
    """Encrypted links only; both ends show a certificate, and the rules say what its name may do."""
    tls = {
        "root_ca_certificate": str(files.authority),
        "listen_certificate": str(files.certificate),
        "listen_private_key": str(files.key),
        "connect_certificate": str(files.certificate),
        "connect_private_key": str(files.key),
        "enable_mtls": True,
        "verify_name_on_connect": files.verify_hosts,
        "close_link_on_expiration": True,
    }
    values: dict[str, object] = {"transport/link/tls": tls, "transport/link/protocols": ["tls", "quic"]}
    return values if files.access_control is None else {**values, "access_control": files.access_control}


def open_error(settings: SessionSettings, error: str) -> str:
    """What to do where a session could not be opened."""
    if "in use" in error.lower() or "listen" in error.lower():
        listened = ", ".join(settings.listen)
        router = " (rmw_zenohd, the router of ROS 2, and zenohd listen on 7447)" if ":7447" in listened else ""
        return (
            f"cannot listen on {listened}: {error}\n"
            f"Another process holds the port{router}; stop it, or choose another one with "
            '-X network.entry="tcp/127.0.0.1:PORT"'
        )
    return f"no Zenoh session: {error}"
