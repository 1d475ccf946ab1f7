"""Keys and tokens of zenoh-plugin-ros2dds and zenoh-bridge-ros2dds, which bring ROS 2 over DDS onto Zenoh.

Data of a topic are under its name, with the bridge's namespace before it and no slash in front. Nothing tells the type
but the token ``@/<session>/@ros2_lv/MP/<key>/<type>/<QoS>``, in which slashes are paragraph signs.
"""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.mesh.ros2.graph import Announced, Endpoint, Node
from lsu_mesh.mesh.ros2.settings import Ros2Network

SLASH = "§"


@dataclass(frozen=True)
class Ros2Dds:
    """The dialect of a network whose bridge has the namespace of its settings."""

    network: Ros2Network
    attaches: bool = False

    def topic(self, name: str) -> str:
        """The absolute name of a topic, the bridge's namespace included."""
        return f"{self.network.namespace.rstrip('/')}/{name.strip('/')}"

    def data_key(self, topic: str, type_name: str, type_hash: str) -> str:
        """Where data of a topic are put; the type is not told."""
        return self.topic(topic).strip("/")

    def data_keys(self, topic: str) -> str:
        """Where data of a topic come from."""
        return self.topic(topic).strip("/")

    def refusal(self, key: str, type_name: str, type_hash: str) -> str:
        """Nothing: a key does not tell the type."""
        return ""

    def publisher_tokens(self, topic: str) -> str:
        """The tokens of the routes of all publishers of a topic."""
        return f"@/*/@ros2_lv/MP/{self.topic(topic).strip('/').replace('/', SLASH)}/*/*"

    def announced(self, token: str) -> Announced | None:
        """What the token of a route tells; the node is not told, only the bridge's session."""
        parts = token.split("/")
        if len(parts) < 6 or parts[2] != "@ros2_lv":
            return None
        return Announced(f"the bridge {parts[1]}", parts[5].replace(SLASH, "/"))

    def node_token(self, node: Node) -> str:
        """None: nodes are those of DDS."""
        return ""

    def endpoint_token(self, node: Node, endpoint: Endpoint) -> str:
        """None: a bridge takes data of any publisher where a subscription of ROS 2 wants them."""
        return ""
