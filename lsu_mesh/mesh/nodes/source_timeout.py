"""Which sources of a node have stopped sending."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.keys import key, last_key
from lsu_mesh.mesh.nodes.node import SECOND, Complaint, Node

STRANGE_SILENCE = 2 * SECOND
"""A source that says nothing for longer, and for longer than usual, is complained of."""


class SourceTimeout(NamedTuple):
    """Since when a source has sent nothing, and its longest pause so far."""

    since: int
    longest: int = 0

    def received(self, now: int) -> SourceTimeout:
        """After one more message."""
        return SourceTimeout(now, max(self.longest, now - self.since))

    def is_strange(self, now: int) -> bool:
        """Whether the present pause is much longer than every one before."""
        return now - self.since > max(STRANGE_SILENCE, 4 * self.longest)


class SourceTimeouts:
    """The pauses of all sources; that of one which has sent nothing yet begins with the first message of any."""

    def __init__(
        self, configuration: Configuration, subscriptions: Sequence[tuple[str, str]], sources: Collection[str]
    ) -> None:
        mesh = configuration.mesh.name
        self._keys = {name: key(mesh, topic, name) for topic, name in subscriptions if name in sources}
        self._known: dict[str, SourceTimeout] = {}
        self._first: int | None = None

    def received(self, source: str, now: int) -> None:
        """A message of a source has come."""
        self._first = now if self._first is None else self._first
        self._known[source] = self._known.get(source, SourceTimeout(now)).received(now)

    def complaints(self, now: int) -> list[Complaint]:
        """One per source whose pause is strange."""
        if self._first is None:
            return []
        silent = [(address, self._known.get(name, SourceTimeout(self._first))) for name, address in self._keys.items()]
        return [
            Complaint("WARN", f"nothing from {address} for {(now - silence.since) / SECOND:.0f} s")
            for address, silence in silent
            if silence.is_strange(now)
        ]


def input_key(configuration: Configuration) -> str:
    """The key that inputs come under."""
    return key(configuration.mesh.name, "input", configuration.plant.name if configuration.plant is not None else "*")


def start_keys(node: Node) -> str:
    """The keys under which a set may come that an estimator can start from."""
    mesh = node.configuration.mesh.name
    own = [last_key(mesh, node.name)] if node.role == "filter" else []
    sets = [key(mesh, topic, name) for topic, name in node.subscriptions() if topic in ("posterior", "fused")]
    return ", ".join([*own, *sets])
