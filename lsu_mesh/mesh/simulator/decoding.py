"""One decoding for all receivers of a payload; what they get is the same frozen message."""

from __future__ import annotations

from lsu_mesh.mesh.messages import Message, decode

MAX_KNOWN = 4096


class SharedDecoder:
    """``decode`` with a memory."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, bytes], Message] = {}

    def decode(self, topic: str, payload: bytes) -> Message:
        """The message in ``payload``; raises ``Refused`` and nothing else."""
        message = self._known.get((topic, payload))
        if message is None:
            message = decode(topic, payload)
            if len(self._known) >= MAX_KNOWN:
                self._known.clear()
            self._known[topic, payload] = message
        return message
