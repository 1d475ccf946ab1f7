"""Who publishes what to whom: the edges of a mesh, from its configuration alone."""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.mesh.access import EVERY_PEER, PUBLISHES, published_topics, recorded, subscriptions
from lsu_mesh.mesh.config.settings import Configuration

Peer = tuple[str, str]
"""``(role, name)``."""


@dataclass(frozen=True)
class Flow:
    """One key: its publisher, and the peers that subscribe to it."""

    topic: str
    name: str
    role: str
    """Of the publisher."""
    readers: tuple[Peer, ...]

    @property
    def address(self) -> str:
        """``topic/name``."""
        return f"{self.topic}/{self.name}"


def in_order(configuration: Configuration) -> list[Peer]:
    """Every peer, as data flow: sources first, the recorder last."""
    order = list(PUBLISHES)
    return sorted(configuration.peers(), key=lambda peer: order.index(peer[0]))


def flows(configuration: Configuration) -> list[Flow]:
    """Every key that peers of the configuration publish: sources first, health and events last.

    A plant without inputs publishes none, a filter without a lag no smoothed sets. A recorder reads everything but
    predictions, which it reads where it is told to or where filters take them; those without a reader are published
    while somebody from outside listens.
    """
    peers = in_order(configuration)
    listened = {peer: set(subscriptions(configuration, *peer)) for peer in peers if peer[0] != "recorder"}
    of_recorder = set(recorded(configuration))
    own = [(role, name, topic) for role, name in peers for topic in published_topics(configuration, role, name)]
    told = [(role, name, topic) for topic in EVERY_PEER for role, name in peers]
    if not configuration.base_model.input_count:
        own = [(role, name, topic) for role, name, topic in own if topic != "input"]

    def readers(topic: str, name: str) -> tuple[Peer, ...]:
        is_recorded = bool({(topic, "*"), (topic, name)} & of_recorder)
        return tuple(
            peer for peer in peers if (is_recorded if peer[0] == "recorder" else (topic, name) in listened[peer])
        )

    return [Flow(topic, name, role, readers(topic, name)) for role, name, topic in [*own, *told]]
