"""Keys and tokens of ROS 2 nodes whose middleware is rmw_zenoh.

Data of a topic are under ``<domain>/<topic>/<type>/<hash>``. Every node, publisher and subscription declares a token
``@ros2_lv/<domain>/<session>/<node>/<entity>/<kind>/<enclave>/<namespace>/<name>[/<topic>/<type>/<hash>/<QoS>]``, in
which slashes are percent signs; the graph of ROS 2 is made of these alone.
"""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.mesh.ros2.graph import Announced, Endpoint, Node, topic_hash_text
from lsu_mesh.mesh.ros2.names import absolute, dds_type, ros_type
from lsu_mesh.mesh.ros2.settings import Ros2Network

ADMIN_SPACE = "@ros2_lv"
DEFAULT_DEPTH = 42
_TOKEN_PARTS = 13


@dataclass(frozen=True)
class RmwZenoh:
    """The dialect of a network with the domain and namespace of its settings."""

    network: Ros2Network
    attaches: bool = True
    """Whether messages carry an attachment."""

    def topic(self, name: str) -> str:
        """The absolute name of a topic."""
        return absolute(name, self.network.namespace)

    def data_key(self, topic: str, type_name: str, type_hash: str) -> str:
        """Where data of a topic are put."""
        return f"{self.network.domain_id}/{self._stripped(topic)}/{dds_type(type_name)}/{type_hash}"

    def data_keys(self, topic: str) -> str:
        """Where data of a topic come from, of whatever type they are, so that a wrong one is seen."""
        return f"{self.network.domain_id}/{self._stripped(topic)}/*/*"

    def _stripped(self, topic: str) -> str:
        return self.topic(topic).strip("/")

    def refusal(self, key: str, type_name: str, type_hash: str) -> str:
        """Why data of a key are not of the type that is expected; empty where they are."""
        _, found, found_hash = key.rsplit("/", 2)
        if found != dds_type(type_name):
            return f"the topic is of type {ros_type(found)}, not {type_name}"
        if found_hash != type_hash:
            return topic_hash_text(type_name, found_hash, type_hash, self.network.distro)
        return ""

    def publisher_tokens(self, topic: str) -> str:
        """The tokens of all publishers of a topic."""
        name = _mangled(self.topic(topic))
        return f"{ADMIN_SPACE}/{self.network.domain_id}/*/*/*/MP/*/*/*/{name}/*/*/*"

    def announced(self, token: str) -> Announced | None:
        """What the token of a publisher tells; None where it is no such token."""
        parts = token.split("/")
        if len(parts) < _TOKEN_PARTS or parts[0] != ADMIN_SPACE:
            return None
        namespace = parts[7].replace("%", "/").rstrip("/")
        return Announced(f"{namespace}/{parts[8]}", ros_type(parts[10]))

    def node_token(self, node: Node) -> str:
        """The token of a node: its own number stands twice."""
        return "/".join(self._head(node, node.number, "NN"))

    def endpoint_token(self, node: Node, endpoint: Endpoint) -> str:
        """The token of a publisher ("MP") or a subscription ("MS")."""
        tail = (
            _mangled(self.topic(endpoint.topic)),
            _mangled(dds_type(endpoint.type)),
            endpoint.type_hash,
            quality_text(endpoint.depth),
        )
        return "/".join((*self._head(node, endpoint.number, endpoint.kind), *tail))

    def _head(self, node: Node, number: int, kind: str) -> tuple[str, ...]:
        enclave = "/"
        return (
            ADMIN_SPACE,
            str(self.network.domain_id),
            node.session,
            str(node.number),
            str(number),
            kind,
            _mangled(enclave),
            _mangled(self.network.namespace),
            node.name,
        )


def quality_text(depth: int) -> str:
    """The quality of service of a reliable, volatile endpoint that keeps ``depth`` messages.

    ``<reliability>:<durability>:<history>,<depth>:<deadline>,:<lifespan>,:<liveliness>,,`` with nothing where it is the
    default.
    """
    return f"::,{'' if depth == DEFAULT_DEPTH else depth}:,:,:,,"


def _mangled(name: str) -> str:
    return name.replace("/", "%")
