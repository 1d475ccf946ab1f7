"""Whether a process is connected to anybody, told truthfully on stderr: at once, and whenever it changes.

Zenoh tries the entry of the mesh for ever and says nothing. A name that nobody knows, or a port at which nobody
listens, then looks like a mesh in which nothing happens. So while a process is connected to nobody, what it tries is
looked at from outside: the name is resolved, and the port is opened.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

LOOK_S = 0.1
ALONE_S = 0.5
"""A process that has been connected to nobody for so long says so, as soon as it knows why."""
MAX_ALONE_S = 0.9
"""Or, after so long, without the reason."""
SETTLED_S, MAX_SETTLING_S = 0.3, 0.9
"""Connected to somebody, it says to how many when that has not changed for so long, and after so long in any case."""
PROBE_PAUSE_S, PROBE_TIMEOUT_S = 2.0, 0.5
UNKNOWN_NAME, REFUSED, NO_ANSWER, NO_SESSION = (
    "name not known", "connection refused", "no answer", "it answers, but there is no session with it yet",
)  # fmt: skip
STREAMS = ("tcp", "tls", "ws")
"""Protocols whose port can be opened to see whether somebody listens; of others only the name is looked up."""


class ConnectionWords:
    """What to say of the connection, and when; times in seconds of a clock that never goes back.

    Parameters
    ----------
    connect, listen:
        Endpoints that the session tries, and at which it listens.
    says_connected:
        Whether to say also that it is connected, where it never said that it was not.
    """

    def __init__(self, connect: Sequence[str], listen: Sequence[str], *, says_connected: bool = True) -> None:
        self.connect, self._listen = tuple(connect), tuple(listen)
        self._says_connected = says_connected
        self._links = 0
        self._began: float | None = None
        """Since when it is connected to nobody, or to somebody."""
        self._changed = 0.0
        self._said = ""
        self._said_alone = False

    def say(self, links: int, reasons: Mapping[str, str] | None, now: float) -> str | None:
        """What has to be said now. ``reasons``: by endpoint, why it does not answer; None: not known yet."""
        if self._began is None or (links == 0) != (self._links == 0):
            self._began = self._changed = now
            self._said = ""
        elif links != self._links:
            self._changed = now
        self._links = links
        text = self._of_nobody(reasons, now - self._began) if links == 0 else self._of_somebody(links, now)
        if text is None or text == self._said:
            return None
        self._said = text
        return text

    def _of_nobody(self, reasons: Mapping[str, str] | None, passed: float) -> str | None:
        knows_why = reasons is not None or not self.connect
        if passed < (ALONE_S if knows_why else MAX_ALONE_S):
            return None
        if not knows_why and self._said:
            return None
        self._said_alone = True
        return alone_words(self.connect, self._listen, reasons or {})

    def _of_somebody(self, links: int, now: float) -> str | None:
        assert self._began is not None
        if self._said or (now - self._changed < SETTLED_S and now - self._began < MAX_SETTLING_S):
            return None
        if not (self._says_connected or self._said_alone):
            return None
        return f"on the mesh: connected to {links} peer{'' if links == 1 else 's'}"


def alone_words(connect: Sequence[str], listen: Sequence[str], reasons: Mapping[str, str]) -> str:
    """That a process is connected to nobody, what it tries, and why that does not answer."""
    if not connect:
        return f"connected to nobody, listening on {', '.join(listen) or 'no address'}"
    if len(connect) == 1:
        why = reasons.get(connect[0])
        return f"connected to nobody, trying {connect[0]}" + (f"; {why}" if why else "")
    tried = [f"{one} ({reasons[one]})" if reasons.get(one) else one for one in connect]
    return f"connected to nobody, trying {', '.join(tried)}"


def why_silent(endpoint: str) -> str:
    """Why an endpoint does not answer, as one more look from this host shows; empty where it cannot be told. Blocks."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.partition("?")[0].partition("#")[0].rpartition(":")
    if not host or not port.isdigit():
        return ""
    try:
        socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_STREAM)
    except (socket.gaierror, UnicodeError):
        return UNKNOWN_NAME
    if protocol not in STREAMS:
        return ""
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=PROBE_TIMEOUT_S):
            return NO_SESSION
    except ConnectionRefusedError:
        return REFUSED
    except OSError:
        return NO_ANSWER


class ConnectionReport:
    """Says on stderr, in a thread of its own, whether a session is connected. Use it as a context manager.

    Parameters
    ----------
    who:
        What each line begins with.
    links:
        Tells to how many others the session is connected.
    """

    def __init__(self, who: str, links: Callable[[], int], words: ConnectionWords) -> None:
        self._who, self._links, self._words, self._connect = who, links, words, words.connect
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="connection", daemon=True)
        self._probe: threading.Thread | None = None
        self._reasons: dict[str, str] | None = None
        self._probed_at = 0.0

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._is_over.wait(LOOK_S):
            now, links = time.monotonic(), self._links()
            if links:
                self._reasons = None
            else:
                self._look(now)
            text = self._words.say(links, self._reasons, now)
            if text is not None:
                print(f"{self._who}: {text}", file=sys.stderr, flush=True)

    def _look(self, now: float) -> None:
        """Find out, in another thread, why nobody answers; the one before has ended."""
        if self._probe is not None and self._probe.is_alive():
            return
        if self._connect and (self._reasons is None or now - self._probed_at > PROBE_PAUSE_S):
            self._probed_at = now
            self._probe = threading.Thread(target=self._find_reasons, name="probe", daemon=True)
            self._probe.start()

    def _find_reasons(self) -> None:
        self._reasons = {endpoint: why_silent(endpoint) for endpoint in self._connect}
