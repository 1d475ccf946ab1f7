"""Configuration and session of a command, from its options."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load
from lsu_mesh.mesh.keys import READER
from lsu_mesh_services.bus import NoSession, SessionSettings
from lsu_mesh_services.exit_codes import COULD_NOT_START, USAGE
from lsu_mesh_services.network.security import InsecureSession, certificates, check_endpoints

DEMO = Path(__file__).resolve().parent / "demo.toml"


def load_or_explain(file: str | None, options: argparse.Namespace) -> Configuration | None:
    """The configuration, or None after its mistakes have been printed on stderr."""
    path = DEMO if file is None else Path(file)
    try:
        return load(path, [*flags(options), *options.overrides], os.environ)
    except ConfigurationError as error:
        print_problems(error)
        return None


def print_warnings(configuration: Configuration) -> None:
    """One line per doubt on stderr."""
    for warning in configuration.warnings:
        print(warning, file=sys.stderr)


def flags(options: argparse.Namespace) -> list[str]:
    """The overrides that short flags stand for."""
    named = {"steps": "mesh.steps", "rate": "mesh.rate", "seed": "mesh.seed"}
    given = {path: getattr(options, flag, None) for flag, path in named.items()}
    return [f"{path}={value}" for path, value in given.items() if value is not None]


def print_problems(error: ConfigurationError) -> None:
    """One line per mistake on stderr."""
    for line in error.problems:
        print(line, file=sys.stderr)
    count = len(error.problems)
    print(f"{count} mistake{'s' if count > 1 else ''}; nothing was started", file=sys.stderr)


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
