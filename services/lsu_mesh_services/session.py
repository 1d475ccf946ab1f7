"""The session of a command with its mesh, from its options and the configuration."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import READER
from lsu_mesh_services.bus import Bus, NoSession, SessionSettings
from lsu_mesh_services.exit_codes import COULD_NOT_START, USAGE
from lsu_mesh_services.network.connection import ConnectionReport, ConnectionWords
from lsu_mesh_services.network.security import InsecureSession, certificates, check_endpoints


def session_settings(configuration: Configuration, options: argparse.Namespace) -> SessionSettings:
    """How a peer of this configuration reaches its mesh: flags first, then ``[network]``.

    A command that runs no peer of the configuration shows the reader's certificate.

    Raises
    ------
    InsecureSession
        When it would be open to other hosts, or has no certificate where the mesh needs one.
    """
    network = configuration.network
    connect = options.connect or [network.entry, *network.connect]
    listen = options.listen or network.listen or (any_port(configuration),)
    check_endpoints(listen, options.cfg, insecure=options.insecure)
    name = options.name if getattr(options, "role", None) is not None else READER
    return SessionSettings(
        connect=tuple(endpoint for endpoint in connect if endpoint not in listen),
        listen=tuple(listen),
        mode=options.mode or "peer",
        cache=configuration.cached,
        multicast=options.multicast_scouting,
        zenoh=tuple(options.cfg),
        certificates=certificates(configuration, name),
    )


def connection_report(
    who: str, bus: Bus, settings: SessionSettings, *, says_connected: bool = True
) -> ConnectionReport:
    """Says on stderr, as long as it is open, when the session is connected to nobody, and when it is again."""
    words = ConnectionWords(settings.connect, settings.listen, says_connected=says_connected)
    return ConnectionReport(who, bus.links, words)


def with_session(who: str, work: Callable[[], int]) -> int:
    """The exit code of ``work``; a session that must not or cannot be opened is explained on stderr."""
    try:
        return work()
    except InsecureSession as error:
        print(f"{who}: {error}", file=sys.stderr)
        return USAGE
    except NoSession as error:
        print(error, file=sys.stderr)
        return COULD_NOT_START


def any_port(configuration: Configuration) -> str:
    """A free port of the loopback interface."""
    return f"{'tls' if configuration.network.tls.enabled else 'tcp'}/127.0.0.1:0"
