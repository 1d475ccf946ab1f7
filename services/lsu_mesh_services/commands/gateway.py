"""``lsu-mesh gateway``: the mesh over HTTP, for browsers and ``curl``."""

from __future__ import annotations

import argparse
import os
import socket
import sys
from pathlib import Path

from lsu_mesh.mesh.config import Configuration
from lsu_mesh_services.bank_limits import refuses_bank
from lsu_mesh_services.bus import Bus, Clock
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE
from lsu_mesh_services.gateway.application import MAX_CLIENTS, Parts, application
from lsu_mesh_services.gateway.event_stream import Clients
from lsu_mesh_services.gateway.http_address import (
    HttpAddress,
    WrongHttpAddress,
    allowed_hosts,
    bind,
    bound,
    read_address,
)
from lsu_mesh_services.gateway.mesh_reader import MeshReader
from lsu_mesh_services.gateway.publisher import Publisher
from lsu_mesh_services.gateway.server import serve
from lsu_mesh_services.gateway.token import WrongToken, read_or_make
from lsu_mesh_services.session import session_settings, with_session

PRIORITY = 5
"""How far the process stands back (``nice``): where processors are short, the mesh is served before its readers."""


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.config, options, makes_filters=False)
    if configuration is None or refuses_bank(configuration, "gateway"):
        return USAGE
    try:
        address = read_address(options.http, allow_remote=options.allow_remote)
        token = _token(configuration, options)
    except (WrongHttpAddress, WrongToken) as error:
        print(error, file=sys.stderr)
        return USAGE
    try:
        listener = bind(address)
    except WrongHttpAddress as error:
        print(error, file=sys.stderr)
        return COULD_NOT_START
    os.nice(PRIORITY)
    with listener:
        address = bound(listener, address)
        return with_session("gateway", lambda: _serve(configuration, options, token, listener=listener, at=address))


def _token(configuration: Configuration, options: argparse.Namespace) -> str | None:
    """The token, if a sensor of the configuration may be published from here."""
    external = [name for name, sensor in configuration.sensors.items() if sensor.live == "external"]
    if not external:
        return None
    default = configuration.path.with_suffix(".gateway-token")
    path = default if options.token_file is None else Path(options.token_file)
    token, is_new = read_or_make(path)
    made = "made" if is_new else "read"
    print(f"gateway: token {made}: {path}; it allows to publish {', '.join(external)}", file=sys.stderr)
    return token


def _serve(
    configuration: Configuration,
    options: argparse.Namespace,
    token: str | None,
    *,
    listener: socket.socket,
    at: HttpAddress,
) -> int:
    clock, settings = Clock(), session_settings(configuration, options)
    clients = Clients(MAX_CLIENTS)
    with Bus(settings, clock) as bus, MeshReader(configuration, bus, clock, tuple(settings.connect)) as reader:
        publisher = Publisher(bus, clock, options)
        parts = Parts(
            configuration=lambda: reader.configuration,
            board=reader.board,
            publisher=publisher,
            token=token,
            now=clock.now,
            clients=clients,
        )
        print(f"gateway: mesh {configuration.mesh.name!r} at {at.url}", file=sys.stderr, flush=True)
        try:
            app = application(parts, allowed_hosts(at, options.host))
            serve(app, listener, clients, lambda: bool(options.stop) or reader.failure is not None)
        finally:
            publisher.close()
    if reader.failure is not None:
        print(f"gateway: stopped reading the mesh: {reader.failure!r}", file=sys.stderr)
        return FAILURE
    return OK
