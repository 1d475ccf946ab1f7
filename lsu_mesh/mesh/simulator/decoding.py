"""One decoding for all receivers of a payload; what they get is the same frozen message."""

from __future__ import annotations

from dataclasses import replace

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import TYPES, Message, read
from lsu_mesh.mesh.simulator.broken import InvariantBroken

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


class Reader:
    """Reads everything that is published as a receiver would: what it refuses no receiver would ever get."""

    def __init__(self, configuration: Configuration, decoder: SharedDecoder) -> None:
        if configuration.mesh.is_live:  # wrong clocks say times after the end: it is the receivers who refuse them
            configuration = replace(configuration, mesh=replace(configuration.mesh, steps=None))
        self._admission = Admission(configuration, TYPES)
        self._admission.decoder = decoder.read

    def read(self, key: str, payload: bytes) -> Message:
        """The message as it comes out of its bytes; raises :class:`InvariantBroken` where it is refused."""
        duplicates = self._admission.duplicates
        message = self._admission.admit(key, payload)
        if message is None:
            why = "published twice" if self._admission.duplicates > duplicates else self._admission.last_refusal
            raise InvariantBroken("decoding", f"{key}: {why}")
        return message
