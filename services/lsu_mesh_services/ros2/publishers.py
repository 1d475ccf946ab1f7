"""Publishers of ROS 2: their tokens, and the attachment of every message."""

from __future__ import annotations

from collections.abc import Iterable

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.ros2.attachment import Attachment, encode_attachment
from lsu_mesh.mesh.ros2.decoder import type_hash_of
from lsu_mesh.mesh.ros2.dialects import dialect_of
from lsu_mesh.mesh.ros2.encoder import gid_of
from lsu_mesh.mesh.ros2.graph import Endpoint, Node
from lsu_mesh.mesh.ros2_telling import Outgoing
from lsu_mesh_services.bus import Bus, Clock

DEPTH = 10
"""What ROS 2 calls the history of a publisher."""
NODE = "lsu_mesh_bridge"


class Ros2Publishers:
    """A node with a publisher for each ``(topic, type)``, in the session of a network of ROS 2."""

    def __init__(self, configuration: Configuration, bus: Bus, clock: Clock, topics: Iterable[tuple[str, str]]) -> None:
        network = configuration.network.ros2
        self._bus, self._clock, self._dialect = bus, clock, dialect_of(network)
        self._keys: dict[tuple[str, str], str] = {}
        self._gids: dict[tuple[str, str], bytes] = {}
        self._sequences: dict[tuple[str, str], int] = {}
        node = Node(bus.zid, 0, NODE)
        if token := self._dialect.node_token(node):
            bus.declare_alive(token)
        for number, (topic, type_name) in enumerate(dict.fromkeys(topics), 1):
            type_hash = type_hash_of(network.distro, type_name)
            self._keys[topic, type_name] = self._dialect.data_key(topic, type_name, type_hash)
            bus.announce_plain(self._keys[topic, type_name])
            token = self._dialect.endpoint_token(
                node, Endpoint("MP", number, topic, type_name, type_hash=type_hash, depth=DEPTH)
            )
            self._gids[topic, type_name] = gid_of(token)
            if token:
                bus.declare_alive(token)

    def tell(self, messages: Iterable[Outgoing]) -> None:
        """Send, each with the next number of its publisher."""
        for one in messages:
            which = one.topic, one.type
            self._sequences[which] = sequence = self._sequences.get(which, 0) + 1
            attachment = encode_attachment(Attachment(sequence, self._clock.now(), self._gids[which]))
            self._bus.put_plain(self._keys[which], one.payload, attachment if self._dialect.attaches else None)
