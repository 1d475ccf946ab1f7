"""The messages of the benchmark mesh, step by step, from its nodes in this process: no network, no waiting."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from lsu_mesh.mesh.access import subscriptions
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Message, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode

START_NS = 1_700_000_000_000_000_000
Step: TypeAlias = Mapping[str, bytes]
"""Payload by key, in the order of publication."""


def time_of(configuration: Configuration, step: int) -> int:
    """A microsecond after a step is due: rounding makes no step late."""
    return START_NS + int((step - 1) / configuration.mesh.rate * 1e9) + 1000


def new_node(configuration: Configuration, role: str, name: str) -> Node:
    """A node of the benchmark mesh that has done nothing yet."""
    boot = f"{sum(map(ord, role + name)):016x}"
    if role == "plant":
        return PlantNode(configuration, name, boot, Schedule(START_NS, configuration.mesh.rate))
    if role == "sensor":
        return SimulatedSensorNode(configuration, name, boot)
    return FilterNode(configuration, name, boot) if role == "filter" else FusionNode(configuration, name, boot)


class LocalMesh:
    """All nodes of a configuration; each message reaches its readers at once."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        peers = [(role, name) for role, name in configuration.peers() if role != "recorder"]
        self._nodes = {(role, name): new_node(configuration, role, name) for role, name in reversed(peers)}
        self._readers: dict[str, list[Node]] = {}
        for (role, name), node in self._nodes.items():
            for topic, other in subscriptions(configuration, role, name):
                self._readers.setdefault(key(configuration.mesh.name, topic, other), []).append(node)
        self._done = 0

    def step(self) -> Step:
        """All messages of the next step but health and events."""
        self._done += 1
        now, published = time_of(self._configuration, self._done), dict[str, bytes]()
        moved = True
        while moved:
            moved = False
            for node in self._nodes.values():
                moved = self._spread(node, node.tick(now), now, published=published) or moved
        return published

    def _spread(self, node: Node, messages: list[Message], now: int, *, published: dict[str, bytes]) -> bool:
        data = [message for message in messages if message.topic not in ("health", "event")]
        for message in data:
            address, payload = node.key(message), encode(message)
            published[address] = payload
            for reader in self._readers.get(address, ()):
                self._spread(reader, reader.deliver(address, payload, now), now, published=published)
        return bool(data)


def local_steps(configuration: Configuration, count: int) -> list[Step]:
    """The first ``count`` steps."""
    mesh = LocalMesh(configuration)
    return [mesh.step() for _ in range(count)]


def message_sizes(configuration: Configuration, steps: int = 40) -> dict[str, int]:
    """Mean bytes of a message at each key, over the later half of so many steps: sets have their full size then."""
    later = local_steps(configuration, steps)[steps // 2 :]
    addresses = {address for step in later for address in step}
    return {
        address: round(sum(len(step[address]) for step in later if address in step) / sum(address in s for s in later))
        for address in sorted(addresses)
    }
