"""``lsu-mesh keys init``: a certificate authority, and a certificate for each peer, reader and router of a mesh."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import READER, ROUTER
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import FAILURE, OK, USAGE
from lsu_mesh_services.network.certificate_authority import LOOPBACK_HOSTS, Authority
from lsu_mesh_services.network.security import certificate_file

MAX_DAYS = 3650


def main(options: argparse.Namespace) -> int:
    options.overrides = [*options.overrides, "network.tls.enabled=true"]  # names are checked as they will be used
    configuration = load_or_explain(options.file, options, makes_filters=False)
    if configuration is None:
        return USAGE
    if not 1 <= options.days <= MAX_DAYS:
        print(f"--days {options.days}: expected 1 to {MAX_DAYS}", file=sys.stderr)
        return USAGE
    try:
        made = make_files(configuration, [*LOOPBACK_HOSTS, *options.host], options.days)
    except (OSError, ValueError) as error:
        print(f"keys init: {error}", file=sys.stderr)
        return FAILURE
    for file in made:
        print(file)
    print(f"{len(made)} files made; those that were there are as they were", file=sys.stderr)
    return OK


def make_files(configuration: Configuration, hosts: Sequence[str], days: int) -> list[Path]:
    """All files of ``[network.tls]`` that are missing; returns those made."""
    tls = configuration.network.tls
    ca_file = certificate_file(configuration, tls.authority, "ca")
    ca_key = ca_file.with_suffix(".key")
    pairs = {
        name: (certificate_file(configuration, tls.certificate, name), certificate_file(configuration, tls.key, name))
        for name in [*(name for _, name in configuration.peers()), READER, ROUTER]
    }
    _check_distinct(pairs, ca_key)
    if ca_file.exists():
        authority, made = Authority.load(ca_file, ca_key), []
    else:
        authority = Authority.new(configuration.mesh.name, days, ca_file, ca_key)
        made = [ca_file, ca_key]
    for name, (certificate, key) in pairs.items():
        if certificate.exists() and key.exists():
            continue
        authority.issue(name, hosts, days, certificate_file=certificate, key_file=key)
        made += [certificate, key]
    return made


def _check_distinct(pairs: dict[str, tuple[Path, Path]], ca_key: Path) -> None:
    files = [ca_key, *(file for pair in pairs.values() for file in pair)]
    if len(set(files)) < len(files):
        raise ValueError(
            '[network.tls] certificate and key must be a file for each peer, such as "keys/{name}.pem"; '
            "two of them share one"
        )
