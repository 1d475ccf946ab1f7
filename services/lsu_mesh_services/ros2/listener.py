"""A sensor's part in ROS 2: it shows its node and subscription, and hands over what comes of the topic."""

from __future__ import annotations

import argparse
from types import TracebackType
from typing import Self

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import Node as MeshNode
from lsu_mesh.mesh.nodes.ros2_sensor import Ros2SensorNode
from lsu_mesh.mesh.ros2.graph import Endpoint, Node
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue
from lsu_mesh_services.peer import OpenBeside
from lsu_mesh_services.ros2.session import open_ros2, ros2_settings

DATA, THERE, GONE = "ros2", "ros2-alive", "ros2-gone"
DEPTH = 10
"""Messages that the subscription says to keep; the queue of the process holds more."""


def beside_mesh(configuration: Configuration, options: argparse.Namespace) -> OpenBeside:
    """Opens the session with ROS 2 of a sensor; raises InsecureSession at once."""
    settings = ros2_settings(configuration, options)

    def opened(node: MeshNode, bus: Bus, clock: Clock) -> Ros2Listener:
        assert isinstance(node, Ros2SensorNode)
        return Ros2Listener(node, settings, clock, bus.arrivals)

    return opened


class Ros2Listener:
    """Use it as a context manager, beside the session of the mesh."""

    def __init__(self, node: Ros2SensorNode, settings: SessionSettings, clock: Clock, arrivals: ReceiveQueue) -> None:
        self._node = node
        self._bus: Bus = open_ros2(settings, clock, arrivals)

    def __enter__(self) -> Self:
        node, topic, dialect = self._node, self._node.topic, self._node.dialect
        shown = Node(self._bus.zid, 0, f"lsu_mesh_{node.name.replace('-', '_')}")
        subscription = Endpoint("MS", 1, topic.topic, topic.type, type_hash=node.type_hash, depth=DEPTH)
        for token in (dialect.node_token(shown), dialect.endpoint_token(shown, subscription)):
            if token:
                self._bus.declare_alive(token)
        self._bus.watch_tokens(dialect.publisher_tokens(topic.topic), THERE, GONE)
        self._bus.subscribe_plain(dialect.data_keys(topic.topic), DATA)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bus.close()

    def look(self) -> None:
        """Note whether anybody of ROS 2 is connected."""
        self._node.listening.links = self._bus.links()

    def take(self, arrival: Arrival) -> list[Message] | None:
        """What to publish after an arrival of ROS 2; None where it is none."""
        if arrival.what == DATA:
            return self._node.take(arrival.key, arrival.payload, arrival.attachment, arrival.arrival_ns)
        if arrival.what not in (THERE, GONE):
            return None
        publishers = self._node.listening.publishers
        if arrival.what == GONE:
            publishers.pop(arrival.key, None)
        elif (announced := self._node.dialect.announced(arrival.key)) is not None:
            publishers[arrival.key] = announced
        return []
