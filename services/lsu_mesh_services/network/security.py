"""The secure side of a session: certificates by name, and the refusal to listen for other hosts without TLS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.network import is_open_to_others
from lsu_mesh.mesh.config.problem import Problem
from lsu_mesh.mesh.config.table import file_at
from lsu_mesh_services.network.access_control import zenoh_access_control

SHARED = 0o077
"""Permissions of a key file that let others than its owner read it."""


class InsecureSession(Exception):
    """The session would be open to others, or its certificate cannot be used; the message says what to do."""


@dataclass(frozen=True)
class Certificates:
    """Files of one end of a link, and what the other ends may do (None: anything, once they have a certificate)."""

    authority: Path
    certificate: Path
    key: Path
    verify_hosts: bool = True
    access_control: Mapping[str, Any] | None = None


def certificates(configuration: Configuration, name: str) -> Certificates | None:
    """The certificates that a peer uses; None without TLS.

    Raises
    ------
    InsecureSession
        When a file is missing, or a key can be read by others.
    """
    tls = configuration.network.tls
    if not tls.enabled:
        return None
    files = [certificate_file(configuration, text, name) for text in (tls.authority, tls.certificate, tls.key)]
    for option, file in zip(("authority", "certificate", "key"), files, strict=True):
        if not file.is_file():
            raise InsecureSession(
                f'{configuration.path}: [network.tls] {option}: there is no file {file} for "{name}"; '
                f"`lsu-mesh keys init {configuration.path}` makes it"
            )
    _check_private(files[2])
    control = zenoh_access_control(configuration) if tls.access_control else None
    return Certificates(
        authority=files[0], certificate=files[1], key=files[2], verify_hosts=tls.verify_hosts, access_control=control
    )


def missing_files(configuration: Configuration) -> list[Problem]:
    """The authority, and the peers whose files are on other hosts or not made yet; one warning each."""
    tls = configuration.network.tls
    if not tls.enabled:
        return []
    authority = certificate_file(configuration, tls.authority, "")
    if not authority.is_file():
        text = f"there is no {authority}; `lsu-mesh keys init {configuration.path}` makes it"
        return [_missing(configuration, "authority", tls.authority, text)]
    names = [name for _, name in configuration.peers()]
    elsewhere = [name for name in names if not certificate_file(configuration, tls.key, name).is_file()]
    text = f"no file on this host for {', '.join(elsewhere)}"
    return [_missing(configuration, "key", tls.key, text)] if elsewhere else []


def _missing(configuration: Configuration, key: str, found: str, text: str) -> Problem:
    file = str(configuration.path)
    return Problem(
        file=file,
        table="network.tls",
        key=key,
        text=text,
        expected="a file on this host",
        found=f'"{found}"',
        is_warning=True,
    )


def certificate_file(configuration: Configuration, text: str, name: str) -> Path:
    """A file of ``[network.tls]`` for a peer; relative ones from the folder of the configuration."""
    return file_at(text.replace("{name}", name), configuration.path.parent)


def _check_private(key: Path) -> None:
    mode = key.stat().st_mode & 0o777
    if mode & SHARED:
        raise InsecureSession(f"{key}: others can read this private key (mode {mode:04o}); chmod 600 {key}")


def check_endpoints(listen: Sequence[str], settings: Sequence[str], *, insecure: bool) -> None:
    """Refuse to listen where anyone on the network could read and write the mesh.

    Raises
    ------
    InsecureSession
        Unless ``insecure`` says that this is meant.
    """
    if insecure:
        return
    for endpoint in listen:
        if is_open_to_others(endpoint):
            raise InsecureSession(
                f"listening on {endpoint} is refused: whoever reaches it could read and write the mesh; "
                "enable [network.tls] (see `lsu-mesh keys init`), or add --insecure where the network itself is closed"
            )
    for setting in settings:
        if setting.startswith("listen/"):
            raise InsecureSession(f"--cfg {setting} is refused without --insecure; use -l")
