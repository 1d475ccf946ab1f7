"""The text of server-sent events."""

from __future__ import annotations


def server_sent(event: str, data: bytes, identity: str = "") -> bytes:
    """One event of a stream of server-sent events; ``data`` is one line."""
    head = f"event: {event}\n" + (f"id: {identity}\n" if identity else "")
    return b"%sdata: %s\n\n" % (head.encode(), data)
