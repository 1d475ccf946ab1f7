"""Where the gateway listens, and which names of it a request may use."""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Iterable
from dataclasses import dataclass

_ADDRESS = re.compile(r"(?:\[(?P<six>[0-9A-Fa-f:.%]+)\]|(?P<host>[A-Za-z0-9._-]+)):(?P<port>\d{1,5})")
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


class WrongHttpAddress(Exception):
    """The address cannot be used; the text says why and what can."""


@dataclass(frozen=True)
class HttpAddress:
    """``host:port``; port 0 is a free one."""

    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches it. Of a name only ``localhost`` is known to be so."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def url(self) -> str:
        """What a browser is given."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"


def read_address(text: str, *, allow_remote: bool) -> HttpAddress:
    """The address in ``HOST:PORT``.

    Raises
    ------
    WrongHttpAddress
        When it is none, or other hosts could reach it and nobody said that they may.
    """
    match = _ADDRESS.fullmatch(text)
    if match is None or int(match["port"]) > 65535:
        raise WrongHttpAddress(f"--http {text}: expected HOST:PORT, such as 127.0.0.1:8080 or [::1]:8080")
    address = HttpAddress(match["six"] or match["host"], int(match["port"]))
    if not address.is_loopback and not allow_remote:
        raise WrongHttpAddress(
            f"--http {text}: other hosts could read the mesh there, without a password or encryption; "
            f"listen on 127.0.0.1:{address.port}, or add --allow-remote where that is meant"
        )
    return address


def bind(address: HttpAddress) -> socket.socket:
    """A listening socket.

    Raises
    ------
    WrongHttpAddress
        When the port is taken or the address is not of this machine.
    """
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((address.host, address.port))
        listener.listen(1024)
    except OSError as error:
        listener.close()
        raise WrongHttpAddress(
            f"--http {address.host}:{address.port}: cannot listen there: {error.strerror}; "
            "stop the process that holds the port, or choose another one (port 0 is a free one)"
        ) from None
    listener.setblocking(False)
    return listener


def bound(listener: socket.socket, address: HttpAddress) -> HttpAddress:
    """The address with the port that the system chose."""
    return HttpAddress(address.host, int(listener.getsockname()[1]))


@dataclass(frozen=True)
class AllowedHosts:
    """Names that the header ``Host`` may hold.

    A page of a stranger can give its own name the address of this machine and so read whatever answers there (DNS
    rebinding). It cannot choose the header: a name that is not ours is refused. Addresses in numbers are no names.
    """

    names: frozenset[str]
    any_number: bool

    def allow(self, header: str) -> bool:
        """Whether a request with this header is for us."""
        host = _host_of(header)
        if host in self.names:
            return True
        return self.any_number and _is_number(host)


def allowed_hosts(address: HttpAddress, further: Iterable[str]) -> AllowedHosts:
    """Of a loopback address its names; of another one also its numbers and this machine's name."""
    names = LOOPBACK_NAMES | {address.host.lower()} | {name.lower() for name in further}
    if not address.is_loopback:
        names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
    return AllowedHosts(names, any_number=not address.is_loopback)


def _host_of(header: str) -> str:
    text = header.strip().lower()
    if text.startswith("["):
        return text[1:].partition("]")[0]
    return text.rpartition(":")[0] if text.count(":") == 1 else text


def _is_number(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
