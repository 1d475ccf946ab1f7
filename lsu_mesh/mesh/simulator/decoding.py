"""One decoding for all receivers of a payload; what they get is the same frozen message."""

from __future__ import annotations

from lsu_mesh.mesh.messages import Message, read

MAX_KNOWN = 4096


class SharedDecoder:
    """``read`` with a memory."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, bytes], tuple[Message, tuple[str, ...]]] = {}

    def read(self, topic: str, payload: bytes) -> tuple[Message, tuple[str, ...]]:
        """The message in ``payload`` and its unknown fields; raises ``Refused`` and nothing else."""
        found = self._known.get((topic, payload))
        if found is None:
            found = read(topic, payload)
            if len(self._known) >= MAX_KNOWN:
                self._known.clear()
            self._known[topic, payload] = found
        return found
