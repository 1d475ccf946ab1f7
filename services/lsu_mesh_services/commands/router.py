"""``lsu-mesh router``: a Zenoh router in this process."""

from __future__ import annotations

import argparse
import sys
import time

from lsu_mesh.mesh.keys import ROUTER
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import OK, USAGE
from lsu_mesh_services.network.security import certificates, check_endpoints
from lsu_mesh_services.peer import MAX_WAIT
from lsu_mesh_services.session import with_session
from lsu_mesh_services.stop import Stop

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"


def main(options: argparse.Namespace) -> int:
    return with_session("router", lambda: _main(options))


def _main(options: argparse.Namespace) -> int:
    settings = _settings(options)
    return USAGE if settings is None else _route(settings, options.stop)


def _settings(options: argparse.Namespace) -> SessionSettings | None:
    """With a configuration: its entry, certificates and rules; None when it has mistakes."""
    files, default = None, DEFAULT_LISTEN
    if options.config is not None:
        configuration = load_or_explain(options.config, options, makes_filters=False)
        if configuration is None:
            return None
        files, default = certificates(configuration, ROUTER), configuration.network.entry
    listen = tuple(options.listen) or (default,)
    check_endpoints(listen, options.cfg, insecure=options.insecure)
    return SessionSettings(
        connect=tuple(options.connect),
        listen=listen,
        mode=options.mode or "router",
        multicast=options.multicast_scouting,
        zenoh=tuple(options.cfg),
        certificates=files,
    )


def _route(settings: SessionSettings, stop: Stop) -> int:
    with Bus(settings, Clock()):
        print(f"router: listening on {', '.join(settings.listen)}", file=sys.stderr)
        while not stop:
            time.sleep(MAX_WAIT)
    return OK
